"""What is said at the end of a search."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.search.local import SearchSummary
from robovast.search.types import Evaluation, ParamSet, SearchReport
from robovast_cli.ui.search_summary import search_lines


@pytest.mark.parametrize(
    ("rates", "said"),
    [
        ([1.0, 0.5, 0.0], "Best: failure_rate 1 with load 0"),
        ([1.0, 1.0, 0.5, 1.0], "Best: failure_rate 1 with load 0 (one of 3 equally good sets)"),
    ],
)
def test_the_best_set_is_one_of_several_where_others_are_as_good(
    rates: list[float], said: str
) -> None:
    known = [Evaluation(ParamSet({"load": n}), {"failure_rate": r}) for n, r in enumerate(rates)]
    report = SearchReport([*known, known[0]], known[0])
    assert list(search_lines(SearchSummary(Path("search"), 4, [], report=report))) == [said]
