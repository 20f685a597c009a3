"""Import paths of notebooks and plugins written for the existing tool (robovast.compat)."""
