"""The operator's clock is the API server's, whatever its machine's says."""

from __future__ import annotations

import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime

import pytest

from robovast_operator.kube import times


@pytest.fixture(autouse=True)
def forget() -> Iterator[None]:
    times._boot = None
    yield
    times._boot = None


def test_no_server_has_told_the_time_yet() -> None:
    for date in ("", "yesterday"):
        times.hear(date)
        before, told, after = datetime.now(UTC), times.now(), datetime.now(UTC)
        assert before - timedelta(seconds=1) < told < after + timedelta(seconds=1)


def test_the_time_is_the_servers() -> None:
    begin, server = time.monotonic(), datetime.now(UTC) - timedelta(hours=1)

    def passed() -> timedelta:
        return timedelta(seconds=time.monotonic() - begin)

    times.hear(format_datetime(server, usegmt=True))
    told = times.now()
    assert abs(told - server) < passed() + timedelta(seconds=2)
    times.hear(format_datetime(server + timedelta(seconds=1), usegmt=True))
    later = times.now()
    assert timedelta(0) < later - told < passed() + timedelta(seconds=0.5), "it is steady"
    times.hear(format_datetime(server + timedelta(minutes=1), usegmt=True))
    assert times.now() - told > timedelta(seconds=50)
