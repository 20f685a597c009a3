"""Pods and their Jobs: made from a plan, and read for what they report."""
