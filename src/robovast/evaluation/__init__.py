"""Reads results for the page, notebooks and assistants.

The modules here only read. A results folder may come from anywhere, so nothing in it is trusted:
paths stay inside it, sizes are limited, and text is data.
"""
