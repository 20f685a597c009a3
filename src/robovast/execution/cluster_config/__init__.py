"""Import path of the base class of cluster kinds, for plugins."""
