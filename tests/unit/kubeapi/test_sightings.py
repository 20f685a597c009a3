"""What is seen of pods reaches those who need it as it is."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.kubeapi.pod_contract.pod_facts import Sightings

IMAGE = "registry:5000/runs@sha256:" + "0" * 64
names = st.text("ab-0", min_size=1, max_size=8)


@given(st.dictionaries(names, st.sampled_from(["one", "other"])), st.frozensets(names))
def test_what_is_written_is_read(images: dict[str, str], killed: frozenset[str]) -> None:
    seen = Sightings(images, killed)
    if seen:
        assert Sightings.load(seen.dump()) == seen


def test_a_pod_costs_ten_bytes() -> None:
    pods = {f"a-long-name-of-a-campaign-1234-17-{n}-x{n:04}": IMAGE for n in range(500)}
    assert len(Sightings(pods).dump()) <= 500 * 14 + 200


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"images": 3}', '{"images": {"x": "y"}}', "[" * 9000, "\xff"]
)
def test_what_makes_no_sense_says_nothing(text: str) -> None:
    assert not Sightings.load(text)


def test_parts_are_one_and_keys_of_later_versions_are_ignored() -> None:
    parts = [Sightings({"a": IMAGE}), Sightings({"b": IMAGE}, frozenset({"a"}))]
    whole = Sightings.together(parts)
    assert whole == Sightings({"a": IMAGE, "b": IMAGE}, frozenset({"a"}))
    later = {**json.loads(whole.dump()), "more": 1}
    assert Sightings.load(json.dumps(later)) == whole
