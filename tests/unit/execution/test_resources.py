"""Amounts are read as Kubernetes writes them, and per-cluster lists by context."""

import pytest

from robovast.base.errors import InputError
from robovast.model.quantities import cpus, gpus, memory, memory_limit, resolve_per_context


@pytest.mark.parametrize(
    ("text", "expected"), [(2, 2.0), ("500m", 0.5), ("1.5", 1.5), (None, None)]
)
def test_cpus(text: object, expected: float | None) -> None:
    assert cpus(text, "cpu") == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [("8Gi", 8 * 2**30), ("512M", 512 * 10**6), (1000, 1000), ("1.5Ki", 1536), (None, None)],
)
def test_memory(text: object, expected: int | None) -> None:
    assert memory(text, "memory") == expected


@pytest.mark.parametrize(("text", "expected"), [(2**20, 2**20), ("1Mi", 2**20), (0, 0)])
def test_a_limit_is_at_least_a_mebibyte_or_none(text: object, expected: int) -> None:
    assert memory_limit(text, "memory") == expected


@pytest.mark.parametrize("text", ["0.5", 0.5, "0.9Ki", 2**20 - 1])
def test_a_fraction_of_a_byte_is_not_taken_for_no_limit(text: object) -> None:
    with pytest.raises(InputError, match="no run can do with less than 1Mi"):
        memory_limit(text, "memory")


@pytest.mark.parametrize("text", ["9" * 400, "8388608Ti", "9" * 400 + "Gi"])
def test_more_memory_than_can_be_counted_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="more memory than any machine has"):
        memory(text, "memory")


@pytest.mark.parametrize(("value", "expected"), [(0, 0), (2, 2), ("1", 1), (None, None)])
def test_gpus(value: object, expected: int | None) -> None:
    assert gpus([{"lab": value}], "gpu", "lab") == expected


@pytest.mark.parametrize("value", ["many", -1, 1.5, [1], True, 10**24])
def test_what_is_no_number_of_gpus_is_refused_by_name(value: object) -> None:
    with pytest.raises(InputError, match=r"resources\.gpu: .* is not a number of GPUs"):
        gpus([{"local": value}], "resources.gpu")


@pytest.mark.parametrize("text", ["many", "-1", "0", "2 cores", "9" * 400])
def test_what_is_no_number_of_cpus_is_refused_by_name(text: str) -> None:
    with pytest.raises(InputError, match=r"execution\.resources\.cpu"):
        cpus(text, "execution.resources.cpu")


def test_a_list_gives_the_value_of_the_context() -> None:
    values = [{"gcp-c4": 4}, {"local": 8}]
    assert resolve_per_context(values, "gcp-c4", "cpu") == 4
    assert cpus(values, "cpu") == 8.0


def test_a_context_without_a_value_is_an_error_that_names_the_others() -> None:
    with pytest.raises(InputError, match="`rke2`; it has values for gcp-c4, local"):
        resolve_per_context([{"gcp-c4": 4}, {"local": 8}], "rke2", "cpu")
