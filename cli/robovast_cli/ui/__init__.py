"""The user interface that all commands share."""
