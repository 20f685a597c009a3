"""The Kubernetes operator: kopf watches, pure functions decide, one loop acts."""
