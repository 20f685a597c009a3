"""Execution of runs: the contract with the container, and local execution."""
