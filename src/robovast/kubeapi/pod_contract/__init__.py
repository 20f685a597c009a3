"""The protocol of a campaign's pods: folders, exit codes, termination messages, pod specs."""
