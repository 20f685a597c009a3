"""What works on users' documents may take any time and memory, and harms nobody."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Callable
from typing import Any

import pytest
from support.kube.fake_cluster import SCENARIO, SETTINGS, campaign

from robovast.base.errors import InputError
from robovast_operator.planning.accept import accept
from robovast_operator.planning.campaign import Accepted
from robovast_operator.planning.separate_processes import Apart, Bounds, TooLargeError

FILES = {"scenario.osc": SCENARIO.encode()}
SMALL = Bounds(60.0, 64 * 2**20)
QUICK = Bounds(0.5, 64 * 2**20)


async def call(apart: Apart, function: Callable[..., Any], *arguments: Any) -> Any:
    """The answer to a single call."""
    async with asyncio.timeout(120):
        return await apart.submit(("lab", "one"), function, *arguments)


def test_an_answer_is_the_answer() -> None:
    """A usual document fits into the bounds of the first attempt."""
    first_only = Apart(long=Bounds(0.0, 0))
    found = asyncio.run(call(first_only, accept, campaign(), FILES, SETTINGS))
    assert isinstance(found, Accepted)
    assert found == accept(campaign(), FILES, SETTINGS)


@pytest.mark.parametrize(
    ("work", "number", "told"),
    [(bytes, 2**30, "more than 64 MiB"), (os._exit, 9, "file ended, probably")],
)
def test_its_end_is_told(work: Any, number: int, told: str) -> None:
    with pytest.raises(InputError, match=told):
        asyncio.run(call(Apart(long=SMALL), work, number))


def test_it_has_only_so_much_time() -> None:
    begun = time.monotonic()
    with pytest.raises(InputError, match=r"longer than 0\.5 s"):
        asyncio.run(call(Apart(QUICK, QUICK), time.sleep, 600))
    assert time.monotonic() - begun < 60


def test_a_document_of_large_values_is_refused_and_the_operator_stays_small() -> None:
    """Each variant has a copy of a value that can be changed."""
    obj = campaign()
    value = [[number] for number in range(2000)]
    files = {"scenario.osc": SCENARIO.replace("float", "their_own_type").encode()}
    obj["spec"]["vast"]["configuration"] = [
        {
            "name": "hall",
            "variations": [
                {
                    "ParameterVariationDistributionUniform": {
                        "name": "speed",
                        "num_variations": 99_000,
                        "min": 0.0,
                        "max": 1.0,
                    }
                },
                {"ParameterVariationList": {"name": "speed", "values": [value]}},
            ],
        }
    ]
    with pytest.raises(InputError, match="more than 64 MiB"):
        asyncio.run(call(Apart(long=SMALL), accept, obj, files, SETTINGS))


def test_a_small_document_passes_heavy_ones_of_other_namespaces() -> None:
    """Five heavy documents in each of two namespaces; the small one waits for neither."""

    async def scenario() -> tuple[float, int]:
        apart = Apart(QUICK, Bounds(30.0, 256 * 2**20))
        await call(apart, int)  # the first process takes longer to start
        heavy = [
            apart.submit((space, str(n)), time.sleep, 1.5) for n in range(5) for space in ("a", "b")
        ]
        await asyncio.sleep(0.2)
        begun = time.monotonic()
        await apart.submit(("light", "small"), accept, campaign(), FILES, SETTINGS)
        took = time.monotonic() - begun
        done = sum(future.done() for future in heavy)
        async with asyncio.timeout(120):
            await asyncio.gather(*heavy)
        return took, done

    took, done = asyncio.run(scenario())
    assert took < 10
    assert done <= 4, "the small document waited for the heavy ones"


def test_what_is_not_wanted_any_more_makes_room() -> None:
    async def scenario() -> float:
        apart = Apart(QUICK, Bounds(600.0, 256 * 2**20))
        running, queued = (apart.submit(("a", n), time.sleep, 500) for n in "ab")
        await asyncio.sleep(3)
        begun = time.monotonic()
        running.cancel()
        queued.cancel()
        async with asyncio.timeout(120):
            await apart.submit(("a", "c"), time.sleep, 1.0)
        return time.monotonic() - begun

    assert asyncio.run(scenario()) < 60


def test_an_object_that_takes_too_much_is_looked_at_later_and_later() -> None:
    async def scenario() -> list[float]:
        apart, waits = Apart(QUICK, QUICK), []
        for _ in range(7):
            with pytest.raises(TooLargeError) as error:
                await call(apart, bytes, 2**30)
            waits.append(float(str(error.value).split()[-5]))
            for delay in apart._delays.values():
                delay.ends = time.monotonic()
        assert await call(apart, int) == 0
        with pytest.raises(TooLargeError, match="checks a change after 10 s"):
            await call(apart, bytes, 2**30)
        late = apart.submit(("lab", "one"), int)
        other = apart.submit(("lab", "other"), int)
        await asyncio.wait_for(other, 60)
        assert not late.done()
        return waits

    assert asyncio.run(scenario()) == [10, 20, 40, 80, 160, 300, 300]
