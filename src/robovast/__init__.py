"""RoboVAST: vary a scenario, run every variant, say what failed, where and why."""

from robovast.base.version import __version__

__all__ = ["__version__"]
