"""The page about security names all objects that the operator may use."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
RULES = (ROOT / "helm/robovast/templates/rbac.yaml").read_text(encoding="utf-8")
PAGE = (ROOT / "docs/reference/cluster-security.md").read_text(encoding="utf-8")
(ROW,) = [line for line in PAGE.splitlines() if line.startswith("| operator | Reads")]
FOUND = {
    name.strip().partition("/")[0]
    for names in re.findall(r"resources: \[([^\]]+)\]", RULES)
    for name in names.split(",")
}
WORDS = {
    "localqueues": "queues",
    "workloadpriorityclasses": "priority classes",
    "multikueueclusters": "worker clusters",
}
"""Words of the page for resources that it does not call by their kind."""


@pytest.mark.parametrize("resource", sorted(FOUND))
def test_each_resource_of_the_rules_is_named(resource: str) -> None:
    assert WORDS.get(resource, resource) in ROW.lower()


def test_the_rules_are_found() -> None:
    assert {"campaigns", "jobs", "pods", "configmaps"} <= FOUND
