"""Tables of a campaign: every run's parameters, verdict and metrics, and every CSV file's rows.

```
runs.py           one row a run
csv_files.py      the CSV files of a run, and their rows whatever state they are in
columnar.py       `_execution/tables.duckdb`, which `vast results query` asks
sqlite_tables.py  `_execution/data.db`
campaign_store.py `campaign.db`
query.py          SQL over the tables of several campaigns
```

All are brought up to date run by run: each run has a *version*, and one whose version is that of
the last time is not read again.
"""
