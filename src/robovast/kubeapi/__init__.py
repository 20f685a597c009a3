"""What operator, agent and command line agree on: custom resources, status, names, pods."""
