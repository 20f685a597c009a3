"""Results as tools for assistants, over the Model Context Protocol.

The tools are read-only and restricted to the results folder. Answers are limited in size; a
truncated answer says how to get the rest.
"""
