"""The cluster as the operator sees it: client, watches, lease, queue of work."""
