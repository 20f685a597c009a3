"""Pods and their Jobs: built from a plan, and read for their reports."""
