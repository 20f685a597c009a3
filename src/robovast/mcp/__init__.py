"""Results as tools for assistants, over the Model Context Protocol.

The tools only read, and only below the results folder. An answer is bounded in size, and says what
was cut and how to get the rest.
"""
