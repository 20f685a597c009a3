"""The lowest layer, independent of RoboVAST: errors, atomic writes, safe paths, plugins."""
