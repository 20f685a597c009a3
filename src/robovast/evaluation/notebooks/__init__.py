"""Notebooks of a campaign's `evaluation.visualization`, executed on request (extra `notebooks`).

workloads.py   which notebooks there are for a campaign, a configuration or a run
data_dir.py    the line of a notebook that says where its data is
child.py       the process that executes one notebook in a kernel and renders it
document.py    the HTML that is shown
runner.py      executes several at once, keeps what they gave
"""
