"""Real containers and a real Kubernetes cluster for tests, on one machine, without a registry."""
