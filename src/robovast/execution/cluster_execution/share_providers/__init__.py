"""Import path of the base class of shares, for plugins."""
