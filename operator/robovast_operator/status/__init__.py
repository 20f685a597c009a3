"""From what is known to status, conditions, events and notices."""
