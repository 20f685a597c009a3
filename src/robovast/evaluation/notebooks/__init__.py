"""Notebooks of a campaign's `evaluation.visualization`, executed on request (extra `notebooks`).

workloads.py   finds the notebooks for a campaign, a configuration or a run
data_dir.py    sets the line of a notebook that refers to its data
child.py       the process that executes one notebook in a kernel and renders it
document.py    the HTML output
runner.py      executes several notebooks in parallel and keeps their results
"""
