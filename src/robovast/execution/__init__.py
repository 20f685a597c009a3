"""Executing runs: the contract with the container, and who starts it."""
