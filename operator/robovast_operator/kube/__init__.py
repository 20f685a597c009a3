"""The cluster as the operator sees it: client, watched objects, lease, work queue."""
