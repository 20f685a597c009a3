"""A package that is missing leads to its extra, also where several packages share a folder."""

from __future__ import annotations

import pytest

from robovast.base.errors import CannotRunError
from robovast.base.optional_deps import GCS, Extra, missing_extra


@pytest.mark.parametrize(
    ("module", "extra", "package"),
    [
        ("google", "gcs", "google.api_core"),
        ("google.cloud", "gcs", "google.cloud.storage"),
        ("google.cloud.storage.retry", "gcs", "google.cloud.storage"),
        ("paramiko.client", "share", "paramiko"),
        ("certifi", "share", "certifi"),
    ],
)
def test_a_missing_module_leads_to_its_extra(module: str, extra: str, package: str) -> None:
    error = missing_extra(ModuleNotFoundError(name=module), "A share")
    assert f"A share needs the extra `{extra}` ({package} is not installed)" in str(error)


@pytest.mark.parametrize("module", ["google.protobuf", "google.cloud.other", "goo", "", None])
def test_other_modules_lead_to_none(module: str | None) -> None:
    error = ModuleNotFoundError(name=module)
    assert missing_extra(error) is None
    with pytest.raises(ModuleNotFoundError), GCS.needed_by("A share"):
        raise error


def test_a_package_in_a_folder_that_is_missing_is_missing() -> None:
    for package in ("nobody_has_this.inner", "google.nobody_has_this", "nobody_has_this"):
        with pytest.raises(CannotRunError, match=rf"\({package} is not installed\)"):
            Extra("own", (package,)).require("It")
    GCS.require("It")
