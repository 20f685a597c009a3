"""The cluster, as the user's kubeconfig leads to it."""
