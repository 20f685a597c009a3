"""The Kubernetes operator: thin kopf handlers over pure functions."""
