"""The version of RoboVAST."""

__version__ = "0.2.0"
