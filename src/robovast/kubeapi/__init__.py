"""The interface of operator, agent and command line: custom resources, status, names, pods."""
