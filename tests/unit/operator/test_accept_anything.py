"""Whatever the API server lets through: a Campaign is accepted or told why not."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.kube.fake_cluster import SCENARIO, SETTINGS, accepted, campaign

from robovast.kubeapi.pod_contract.messages import Composed
from robovast_operator.planning.accept import accept, with_composition
from robovast_operator.planning.campaign import Accepted, Rejected

anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=12),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=12), inner, max_size=3)
    ),
    max_leaves=6,
)


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The path of every value below."""
    items: Any = ()
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = enumerate(value)
    return [path, *(place for key, item in items for place in places(item, (*path, key)))]


SPEC = campaign()["spec"]
PLACES = [path for path in places(SPEC) if path]


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(PLACES), anything)
def test_any_value_anywhere_is_taken_or_explained(path: tuple[Any, ...], value: Any) -> None:
    obj = campaign()
    spec = obj["spec"] = copy.deepcopy(SPEC)
    for key in path[:-1]:
        spec = spec[key]
    spec[path[-1]] = value
    found = accept(obj, {"scenario.osc": SCENARIO.encode()}, SETTINGS)
    assert isinstance(found, Accepted | Rejected)
    if isinstance(found, Rejected):
        assert found.reason
        assert found.message


@pytest.mark.parametrize(
    ("files", "told"),
    [
        (["a", "a/b"], "`a` is a file, and a folder"),
        (["x" * 300], "longer than 255 bytes"),
        (["ü" * 128], "longer than 255 bytes"),
        (["a/b", "a//b"], "one path, spelt in two ways"),
        (["../x"], "leaves the document's folder"),
    ],
)
def test_files_that_no_folder_can_hold_are_refused(files: list[str], told: str) -> None:
    obj = campaign()
    obj["spec"]["source"]["inline"]["files"] |= dict.fromkeys(files, "")
    given = dict.fromkeys(obj["spec"]["source"]["inline"]["files"], b"")
    found = accept(obj, given | {"scenario.osc": SCENARIO.encode()}, SETTINGS)
    assert isinstance(found, Rejected)
    assert told in found.message


def test_a_document_that_is_nested_deeply_is_refused() -> None:
    obj = campaign()
    value: Any = 1
    for _ in range(5000):
        value = [value]
    obj["spec"]["vast"]["metadata"] = {"notes": value}
    assert isinstance(accept(obj, {"scenario.osc": SCENARIO.encode()}, SETTINGS), Rejected)


@pytest.mark.parametrize(
    "said",
    [
        ([3], "1-10000000"),
        ([3], "2,1"),
        ([3], "x"),
        ([2**31 - 1], ""),
        ([1, 1], ""),
    ],
)
def test_what_a_compose_pod_says_is_held_against_the_document(said: tuple[list[int], str]) -> None:
    counts, breaks = said
    composed = Composed(counts=tuple(counts), breaks=breaks)
    made = with_composition(accepted(), composed, 100_000, "InvalidDocument")
    assert isinstance(made, Rejected)
    fine = Composed(counts=(3,), breaks="1-2")
    assert isinstance(with_composition(accepted(), fine, 100_000, "x"), Accepted)


@pytest.mark.parametrize(
    ("image", "seed", "told"),
    [
        ("runs@sha256:" + "0" * 64, 7, ""),
        ("runs:1", 7, "runs:1 has none. Use IMAGE@sha256:DIGEST."),
        ("runs@sha256:" + "0" * 64, None, "Set `execution.seed`"),
    ],
)
def test_runs_are_taken_over_only_where_it_is_known_what_they_are(
    image: str, seed: int | None, told: str
) -> None:
    obj = campaign(reuse=True, image=image)
    obj["spec"]["vast"]["execution"]["seed"] = seed
    settings = replace(SETTINGS, reuse_namespaces=("*",))
    found = accept(obj, {"scenario.osc": SCENARIO.encode()}, settings)
    if told:
        assert isinstance(found, Rejected)
        assert told in found.message
    else:
        assert isinstance(found, Accepted)
        assert found.spec.reuse


@pytest.mark.parametrize("allowed", [(), ("other",), ("lab", "other"), ("*",)])
def test_runs_are_reused_only_in_namespaces_that_an_administrator_allows(
    allowed: tuple[str, ...],
) -> None:
    """Anyone with the keys of the storage can forge runs that others reuse."""
    obj = campaign(reuse=True, image="runs@sha256:" + "0" * 64)
    obj["metadata"]["namespace"] = "lab"
    obj["spec"]["vast"]["execution"]["seed"] = 7
    settings = replace(SETTINGS, reuse_namespaces=allowed)
    found = accept(obj, {"scenario.osc": SCENARIO.encode()}, settings)
    if {"lab", "*"} & set(allowed):
        assert isinstance(found, Accepted)
    else:
        assert isinstance(found, Rejected)
        assert found.reason == "ReuseNotAllowed"
        assert "policies.reuseNamespaces" in found.message
