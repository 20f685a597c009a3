"""Campaigns that are divided among clusters."""

from __future__ import annotations

import pytest

from robovast.kubeapi.names import CAMPAIGN_NAME_LIMIT
from robovast_cli.commands.exec.cluster.parts import part_name


@pytest.mark.parametrize("words", ["drive", "a-" * 17, "a" * 34, "a" * 30 + "-bcd"])
def test_parts_of_two_campaigns_of_one_document_never_have_one_name(words: str) -> None:
    names = [f"{words.rstrip('-')}-{mark}" for mark in ("x7k2p", "x7k2q")]
    assert all(len(name) <= CAMPAIGN_NAME_LIMIT for name in names)
    found = [part_name(name, number, 12) for name in names for number in range(1, 13)]
    assert len(set(found)) == len(found)
    assert all(len(name) <= CAMPAIGN_NAME_LIMIT and "--" not in name for name in found)
    assert part_name(names[0], 1, 1) == names[0]
