"""Jobs in queues of Kueue."""
