"""Searches: a strategy proposes parameter sets, their runs are scored, it proposes again.

```
types.py, strategy.py, extractor.py    what plugins of users build on
strategies/, extractors/               the built-in ones
plugins.py     finds both and makes them
history.py     what a search has stored; everything that decides is rebuilt from it
rounds.py      one batch after the other
local.py       searches on this machine
```
"""
