"""The version of RoboVAST."""

__version__ = "0.3.0"
