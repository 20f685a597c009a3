"""RoboVAST: vary a scenario, run every variant, say what failed, where and why."""

__version__ = "0.1.0"
