"""Jobs that wait in queues of Kueue."""
