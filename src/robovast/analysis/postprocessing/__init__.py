"""Postprocessing: raw results become tables, metadata and a provenance graph.

```
session.py     all campaigns of a results folder
campaign.py    one campaign: looks at what changed, calls what is stale
commands.py    the commands of a .vast file, with keys that change when their results may
survey.py, content.py, state.py    what changed, and what is finished
plan.py        which commands are to be called, for which runs
run_step.py    all commands of one run
worker.py, child.py, guard.py      plugins in processes of their own
records.py     postprocessing.yaml: what was made of what
finish.py      tables and metadata
```
"""
