"""Import paths of plugins."""
