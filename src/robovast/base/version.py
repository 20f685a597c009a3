"""The version of RoboVAST."""

__version__ = "0.1.0"
