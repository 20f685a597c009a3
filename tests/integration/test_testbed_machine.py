"""A machine that cannot host a testbed: say what is missing, once."""

import os

import pytest
from robovast_testbed import bed, cache
from robovast_testbed.errors import Unavailable
from robovast_testbed.pytest_plugin import skipped_when_unavailable


def test_without_root_the_reason_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.delenv("ROBOVAST_TESTBED", raising=False)

    with pytest.raises(Unavailable, match="needs root"), bed.session("never"):
        pass


def test_elsewhere_a_missing_part_is_a_skip(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CI", raising=False)

    with pytest.raises(pytest.skip.Exception, match="no Go"), skipped_when_unavailable():
        raise Unavailable("no Go")


def test_in_ci_a_missing_part_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CI", "true")
    monkeypatch.delenv("ROBOVAST_TESTBED", raising=False)

    with pytest.raises(Unavailable, match="no Go"), skipped_when_unavailable():
        raise Unavailable("no Go")


def test_engines_that_are_off_are_neither_started_nor_built(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CI", "true")
    monkeypatch.setenv("ROBOVAST_TESTBED", "off")

    with pytest.raises(pytest.skip.Exception, match="--all"), skipped_when_unavailable():
        cache.once("never-built", lambda _: None)
    skip = pytest.raises(pytest.skip.Exception, match="--all")
    with skip, skipped_when_unavailable(), bed.session("never"):
        pass
