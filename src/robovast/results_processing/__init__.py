"""Import paths of plugins that were written for the existing tool (robovast.compat)."""
