"""Variants are counted before they are made."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.kube.fake_cluster import SCENARIO, SETTINGS, campaign

from robovast.base.errors import InputError
from robovast.base.serialization import dump_yaml
from robovast.model.document import load_document
from robovast.model.expansion import expand
from robovast.model.expansion.limit import count_entry, variant_limit
from robovast_operator.planning.accept import accept
from robovast_operator.planning.campaign import Rejected

LIST = {"ParameterVariationList": {"name": "speed", "values": [1.0] * 1000}}


def drawn(number: int) -> dict[str, object]:
    given = {"name": "speed", "num_variations": number, "min": 0.0, "max": 1.0}
    return {"ParameterVariationDistributionUniform": given}


TOO_MANY = [
    ([drawn(10**9)], "1,000,000,000"),
    ([LIST, LIST], "1,000,000"),
    ([{"OneOfVariation": {"variations": [drawn(70_000), drawn(50_000)]}}], "120,000"),
    ([drawn(10**9)] * 300, "1,000,000,000,000,000,000"),
]


def document(folder: Path, variations: list[object]) -> Path:
    vast = campaign()["spec"]["vast"]
    vast["configuration"] = [{"name": "hall", "variations": variations}]
    (folder / "scenario.osc").write_text(SCENARIO)
    path = folder / "d.vast"
    path.write_text(dump_yaml(vast))
    return path


@pytest.mark.parametrize(("variations", "number"), TOO_MANY)
def test_too_many_are_refused_at_once_with_their_number(
    tmp_path: Path, variations: list[object], number: str
) -> None:
    loaded = load_document(document(tmp_path, variations))
    begun = time.process_time()
    with pytest.raises(InputError, match=f"would have {number} configurations, more than 100,000"):
        expand(loaded, tmp_path)
    assert time.process_time() - begun < 3


@pytest.mark.parametrize(("variations", "number"), TOO_MANY)
def test_the_operator_says_the_same(variations: list[object], number: str) -> None:
    obj = campaign()
    obj["spec"]["vast"]["configuration"] = [{"name": "hall", "variations": variations}]
    begun = time.process_time()
    found = accept(obj, {"scenario.osc": SCENARIO.encode()}, SETTINGS)
    assert isinstance(found, Rejected)
    assert f"would have {number} configurations" in found.message
    assert time.process_time() - begun < 3


calls = st.one_of(
    st.integers(1, 3).map(drawn),
    st.lists(st.floats(0, 9), min_size=1, max_size=3).map(
        lambda values: {"ParameterVariationList": {"name": "speed", "values": values}}
    ),
)
nested = calls | st.lists(calls, min_size=1, max_size=3).map(
    lambda some: {"OneOfVariation": {"variations": some}}
)


@settings(max_examples=25, deadline=None)
@given(st.lists(nested, min_size=1, max_size=3))
def test_what_is_counted_is_what_is_made(
    tmp_path_factory: pytest.TempPathFactory, variations: list[object]
) -> None:
    folder = tmp_path_factory.mktemp("d")
    loaded = load_document(document(folder, variations))
    (entry,) = loaded.vast.configuration or []
    assert count_entry(loaded, entry) == len(expand(loaded, folder))


PLUGIN = """\
from robovast.common.variation import Variation

class Many(Variation):
    def variation(self, in_configs):
        return [self.update_config(config, {}) for config in in_configs for _ in range(11)]
"""


def test_what_cannot_be_counted_is_refused_once_it_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "many.py").write_text(PLUGIN)
    monkeypatch.setenv("ROBOVAST_VARIANT_LIMIT", "10")
    with pytest.raises(InputError, match="would have 11 configurations, more than 10"):
        expand(load_document(document(tmp_path, [{"./many.py:Many": {}}])), tmp_path)


@pytest.mark.parametrize("text", ["x", "0", "-1", "9" * 5000])
def test_a_limit_is_a_number(text: str) -> None:
    with pytest.raises(InputError, match="ROBOVAST_VARIANT_LIMIT"):
        variant_limit({"ROBOVAST_VARIANT_LIMIT": text})


def test_a_campaign_has_only_so_many_runs() -> None:
    found = accept(campaign(runs=100_000), {"scenario.osc": SCENARIO.encode()}, SETTINGS)
    assert not isinstance(found, Rejected)
    obj = campaign(runs=100_000)
    obj["spec"]["vast"]["configuration"] = [{"name": "hall", "variations": [drawn(1000)]}]
    found = accept(obj, {"scenario.osc": SCENARIO.encode()}, SETTINGS)
    assert isinstance(found, Rejected)
    assert "100,000,000 runs" in found.message
