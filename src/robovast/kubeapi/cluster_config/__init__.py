"""Kinds of clusters: how RoboVAST is set up on each (entry points `robovast.cluster_configs`)."""
