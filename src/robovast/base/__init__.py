"""The lowest layer, which knows nothing of RoboVAST: errors, atomic writes, safe paths, plugins."""
