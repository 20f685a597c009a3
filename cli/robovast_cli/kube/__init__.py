"""Access to the cluster of the user's kubeconfig."""
