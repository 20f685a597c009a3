"""Postprocessing: converts raw results to tables, metadata and a provenance graph.

```
session.py     processes all campaigns of a results folder
campaign.py    processes one campaign: finds changes, calls outdated commands
commands.py    the commands of a .vast file, with keys that change when their results may
survey.py, content.py, state.py    find changes, store finished work
plan.py        decides which commands to call, for which runs
run_step.py    calls all commands for one run
worker.py, child.py, guard.py      execute plugins in separate processes
records.py     postprocessing.yaml: the origin of generated files
finish.py      tables and metadata
```
"""
