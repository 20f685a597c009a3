"""From an object to a plan."""
