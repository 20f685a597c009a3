"""Our containers in a campaign's pods: they prepare what runs need and store what runs leave.

Knows no Kubernetes client: a pod is mounted folders, an environment variable and exit codes.
docs/contributing/agent.md describes the interfaces.
"""
