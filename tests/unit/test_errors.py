"""Errors keep their cause on any way to the user."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from robovast.base.errors import DocumentError, InputError, Place, Problem
from robovast_cli.ui.report import message_of


@pytest.mark.parametrize("path", ["..", ".", "/data/.", "../.."])
def test_a_message_ends_with_the_path_that_it_names(path: str) -> None:
    assert message_of(InputError(f"cannot write into {path}")) == f"error: cannot write into {path}"


def test_a_sentence_loses_its_period() -> None:
    assert message_of(InputError("the disk is full.")) == "error: the disk is full"


def test_an_error_without_a_text_has_that_of_its_cause() -> None:
    error = InputError()
    assert error.message == "the cause is unknown"
    error.__cause__ = OSError("no space left")
    assert error.message == "no space left"


def test_an_error_about_a_document_passes_between_processes() -> None:
    problems = [Problem(Place(Path("a.vast"), 3, 1), "execution", "is missing", "add it")]
    found = pickle.loads(pickle.dumps(DocumentError(problems)))  # noqa: S301
    assert found.problems == problems
