"""A CSV file has the same rows in tables whatever its size, and whatever its form."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.campaigns.finished import finished_campaign

from robovast.analysis.tables import columnar
from robovast.analysis.tables.columnar import update_columnar
from robovast.analysis.tables.query import Answer, ask
from robovast.campaign.layout import Layout

PIECES = st.sampled_from(
    ["a", "1", ",", ",", "\n", "\n", "\r\n", '"', '"', '""', " ", "\t", "#", "\r", "\n\n", '"a\nb"']
)
HEADS = st.sampled_from(
    ["a,b\n", "a\n", "\n\na,b\n", "\ufeff# c\na,b\n", '"a\nc",b\n', "#a,b\n1,2\n"]
)
RECORDS = st.lists(
    st.sampled_from(
        ['1, "a,b"', "1,2", "", '"a" ,2', '1,"a"', '1,a"b', '1,"c ""d"" e"', "  ", "x"]
    ),
    max_size=8,
).map("\n".join)


def rows_of(folder: Path, content: str) -> Answer:
    campaign = finished_campaign(folder, 1)
    (campaign / "c-1/0/x.csv").write_bytes(content.encode())
    update_columnar(Layout(campaign), {"c-1/0": "1"})
    return ask([campaign], "SELECT * EXCLUDE (campaign, config, run) FROM x")


@given(HEADS, RECORDS | st.lists(PIECES, max_size=30).map("".join))
@settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck))
def test_large_files_have_the_rows_of_small_ones(
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
    head: str,
    records: str,
) -> None:
    found = []
    for smallest in (1 << 20, 0):
        monkeypatch.setattr(columnar, "_SMALL", smallest)
        found.append(rows_of(tmp_path_factory.mktemp("all"), head + records))
    assert found[0] == found[1]
