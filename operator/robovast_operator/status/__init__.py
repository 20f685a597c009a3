"""From a snapshot to status, conditions, Events and notices."""
