"""Campaigns under faults drawn at random, compared with the truth."""
