"""Tables of a campaign: parameters, verdict and metrics of all runs, and rows of all CSV files.

```
runs.py           one row per run
csv_files.py      the CSV files of a run, and their rows, even of damaged files
columnar.py       `_execution/tables.duckdb`, used by `vast results query`
sqlite_tables.py  `_execution/data.db`
campaign_store.py `campaign.db`
query.py          SQL over the tables of several campaigns
```

Tables are updated run by run: a run is read again only if its *version* has changed.
"""
