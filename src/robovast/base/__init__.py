"""What everything stands on and nothing of RoboVAST is in: errors, files, plugins, patience."""
