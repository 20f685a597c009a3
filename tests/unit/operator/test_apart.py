"""What works on users' documents may take any time and memory, and harms nobody."""

from __future__ import annotations

import asyncio
import os
import time
from typing import Any

import pytest
from support.kube.fake_cluster import SCENARIO, SETTINGS, campaign

from robovast.base.errors import InputError
from robovast_operator.planning.accept import accept
from robovast_operator.planning.apart import Apart
from robovast_operator.planning.campaign import Accepted

FILES = {"scenario.osc": SCENARIO.encode()}


def test_an_answer_is_the_answer() -> None:
    found = asyncio.run(Apart()(accept, campaign(), FILES, SETTINGS))
    assert isinstance(found, Accepted)
    assert found == accept(campaign(), FILES, SETTINGS)


@pytest.mark.parametrize(
    ("work", "number", "told"),
    [(bytes, 2**30, "more than 64 MiB"), (os._exit, 9, "its process died")],
)
def test_its_end_is_told(work: Any, number: int, told: str) -> None:
    with pytest.raises(InputError, match=told):
        asyncio.run(Apart(memory=64 * 2**20)(work, number))


def test_it_has_only_so_much_time() -> None:
    begun = time.monotonic()
    with pytest.raises(InputError, match="longer than 1 s"):
        asyncio.run(Apart(seconds=1.0)(time.sleep, 600))
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
        asyncio.run(Apart(memory=64 * 2**20)(accept, obj, files, SETTINGS))
