"""Writes rows to a CSV file; different rows may have different columns."""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import lru_cache
from io import TextIOWrapper
from itertools import chain, islice
from operator import itemgetter
from pathlib import Path
from typing import Any

from robovast.analysis.tables.csv_files import column_names
from robovast.base.atomic import part_name, put_in_place
from robovast.base.errors import InputError
from robovast.base.safe_paths import create_file

Key = Hashable
"""Determines the cells of a row, such as the shape of a message."""

_BUFFER = 1 << 20
_MOST_CELLS = 1 << 30
"""Most cells of a table that is rewritten because its rows have different columns."""


Columns = Callable[[Any], list[list[str]]]
"""Column names of each cell of a row, by the row's key."""


def no_columns(_key: Key) -> list[list[str]]:
    """No columns besides the leading ones."""
    return []


class CsvTable:
    """A CSV file: leading columns, then the others sorted by name. Equal names get numbers.

    Every row has a key that determines its cells. Rows are written immediately; if their keys
    differ, the file is rewritten at the end with the columns of all keys.
    """

    def __init__(
        self,
        path: Path,
        leading: Sequence[str],
        columns: Columns = no_columns,
        title: Callable[[str], str] | None = None,
    ) -> None:
        """Create a file that gets its final name when it is closed.

        Args:
            path: the CSV file.
            leading: names of the cells that every row begins with.
            columns: names of the columns of each further cell, by the row's key.
            title: what the file calls a column, by its name; then all columns are sorted by it,
                the leading ones, too.
        """
        self.path = path
        self._leading = list(leading)
        self._columns = columns
        self._title = title
        self._part = part_name(path)
        self._file = create_file(self._part, buffering=_BUFFER)
        self._runs: list[tuple[Key, int]] = []
        self._key: Key | None = None
        self._count = 0
        self._order: Any = None
        self._orders = lru_cache(maxsize=256)(self._order_of)

    def add(self, key: Key, cells: list[bytes]) -> None:
        """Write a row: the leading cells, then the key's cells."""
        if key != self._key:
            self._switch(key)
        self._count += 1
        self._file.write(b",".join(self._order(cells)) + b"\n")

    def add_lines(self, lines: Iterable[bytes], key: Key = ()) -> None:
        """Write formatted rows, all with one key."""
        if key != self._key:
            self._switch(key)
        self._file.writelines(line + b"\n" for line in lines)

    @property
    def is_empty(self) -> bool:
        """True if the table has no rows."""
        return self._key is None

    def close(self) -> None:
        """Complete the file and rename it to its final name.

        Raises:
            InputError: it would be too large.
        """
        self._end_run()
        keys = list(dict.fromkeys(key for key, _ in self._runs))
        self._file.close()
        if len(keys) == 1 and self._title is None:
            put_in_place(self._part, self.path, lasting=False)
        else:
            self._rewrite(keys)

    def discard(self) -> None:
        """Remove unfinished files."""
        self._file.close()
        self._part.unlink(missing_ok=True)

    def _switch(self, key: Key) -> None:
        self._end_run()
        if not self._runs:
            names = column_names([*self._leading, *self._sorted(key)], ())
            self._file.write((",".join(names) + "\n").encode())
        self._order = self._orders(key)
        self._key, self._count = key, 0

    def _end_run(self) -> None:
        if self._key is not None:
            self._runs.append((self._key, self._count))

    def _order_of(self, key: Key) -> Any:
        """A function that sorts a row's cells into file order."""
        lead = len(self._leading)
        cells = self._columns(key)
        rest = sorted(range(len(cells)), key=lambda place: cells[place][0])
        return _getter([*range(lead), *(lead + place for place in rest)])

    def _sorted(self, key: Key) -> list[str]:
        return sorted(chain.from_iterable(self._columns(key)))

    def _rewrite(self, keys: list[Key]) -> None:
        names = sorted({name for key in keys for name in self._sorted(key)})
        columns = [*((True, name) for name in self._leading), *((False, name) for name in names)]
        count_of_rows = sum(count for _, count in self._runs)
        if len(columns) * count_of_rows > _MOST_CELLS:
            raise InputError(
                f"{self.path.name} would have {count_of_rows:,} rows of {len(columns):,} columns, "
                f"more than {_MOST_CELLS:,} cells: the lengths of its arrays differ too much",
                hint="exclude its topic, or convert the topic with your own command",
            )
        title = self._title or str
        if self._title is not None:
            columns.sort(key=lambda column: title(column[1]))
        final = part_name(self.path)
        csv.field_size_limit(sys.maxsize)  # a cell holds a whole string, however long
        with (
            self._part.open(newline="", encoding="utf-8") as source,
            TextIOWrapper(create_file(final), newline="", encoding="utf-8") as target,
        ):
            rows = csv.reader(source)
            next(rows, None)
            writer = csv.writer(target, lineterminator="\n")
            writer.writerow(column_names([title(name) for _, name in columns], ()))
            # few, as each is as long as a row
            spread = lru_cache(maxsize=8)(lambda key: self._spread(key, columns))
            for key, count in self._runs:
                order = spread(key)
                writer.writerows(order([*row, ""]) for row in islice(rows, count))
        self._part.unlink()
        put_in_place(final, self.path, lasting=False)

    def _spread(self, key: Key, columns: list[tuple[bool, str]]) -> Any:
        """A function that maps a key's row, with an empty cell at its end, to the common columns.

        Args:
            key: the row's key.
            columns: for each column, whether it is a leading one, and its name.
        """
        every = [*((True, name) for name in self._leading)]
        every += ((False, name) for name in self._sorted(key))
        place = {column: index for index, column in enumerate(every)}
        return _getter([place.get(column, -1) for column in columns])


def written(table: CsvTable) -> list[Path]:
    """The complete table's file; a table without rows is not written."""
    if table.is_empty:
        table.discard()
        return []
    table.close()
    return [table.path]


def _getter(places: list[int]) -> Any:
    if len(places) > 1:
        return itemgetter(*places)
    return lambda cells: [cells[place] for place in places]
