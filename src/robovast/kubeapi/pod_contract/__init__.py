"""The protocol of a campaign's pods: folders, exit codes, last words, and how a pod is made."""
