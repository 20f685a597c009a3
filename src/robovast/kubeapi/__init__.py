"""Campaigns on a cluster: names, plan, storage. Knows no Kubernetes client."""
