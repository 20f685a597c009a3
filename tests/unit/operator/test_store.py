"""What the operator knows of Configurations, by the Campaign that each names."""

from __future__ import annotations

from typing import Any

from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import Store


def _configuration(name: str, campaign: Any, version: int = 1, uid: str = "") -> Object:
    return {
        "metadata": {
            "namespace": "lab",
            "name": name,
            "uid": uid or f"uid-{name}",
            "resourceVersion": str(version),
            "creationTimestamp": "2026-01-01T00:00:00Z",
        },
        "spec": {"campaign": campaign},
    }


def _names(store: Store, campaign: str) -> list[str]:
    return [obj["metadata"]["name"] for obj in store.configurations_of(("lab", campaign))]


def test_the_configurations_of_a_campaign_are_those_that_name_it_now() -> None:
    store = Store()
    for name in ("b", "a"):
        assert store.put_configuration(_configuration(name, "drive"))
    assert _names(store, "drive") == ["a", "b"]
    assert store.put_configuration(_configuration("a", "grow", version=2))
    assert (_names(store, "drive"), _names(store, "grow")) == (["b"], ["a"])
    assert not store.put_configuration(_configuration("a", "drive"))
    assert (_names(store, "drive"), _names(store, "grow")) == (["b"], ["a"])
    assert store.put_configuration(_configuration("a", "drive", uid="another"))
    assert store.drop_configuration(("lab", "a", "uid-a")) is None
    assert (_names(store, "drive"), _names(store, "grow")) == (["a", "b"], [])
    assert store.drop_configuration(("lab", "a", "another")) is not None
    assert _names(store, "drive") == ["b"]


def test_a_configuration_that_names_no_campaign_belongs_to_none() -> None:
    store = Store()
    for number, campaign in enumerate(("", None, 3, ["drive"])):
        assert store.put_configuration(_configuration(f"c{number}", campaign))
        assert _names(store, "") == []
        assert store.drop_configuration(("lab", f"c{number}", f"uid-c{number}")) is not None
    assert not store.configurations
