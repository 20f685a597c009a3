"""YAML's `true` and `no` are no numbers, in no key of any model of untrusted documents."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pydantic import BaseModel, ValidationError

import robovast.model.document.model
import robovast.model.variations.parameter_variation
import robovast.search.strategies.archives
import robovast.search.strategies.boundary  # noqa: F401  # defines further models
from robovast.model.document.model import Vast
from robovast.model.strict_numbers import StrictNumbers


def subclasses(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    for sub in model.__subclasses__():
        if sub.__module__.startswith("robovast."):
            yield sub
            yield from subclasses(sub)


def number_keys() -> Iterator[tuple[type[BaseModel], str]]:
    for model in sorted(set(subclasses(StrictNumbers)), key=repr):
        for key, schema in model.model_json_schema()["properties"].items():
            options = [schema, *schema.get("anyOf", ())]
            kinds = {option.get("type", type(option.get("const")).__name__) for option in options}
            if kinds & {"integer", "number", "int"} and not kinds & {"boolean", "string"}:
                yield model, key


KEYS = list(number_keys())


@pytest.mark.parametrize("value", [True, False])
@pytest.mark.parametrize(("model", "key"), KEYS, ids=[f"{m.__name__}.{key}" for m, key in KEYS])
def test_a_truth_value_is_no_number(model: type[BaseModel], key: str, value: bool) -> None:
    with pytest.raises(ValidationError) as caught:
        model.model_validate({key: value})
    assert key in {error["loc"][0] for error in caught.value.errors()}


def test_the_version_of_the_format_is_among_them() -> None:
    assert (Vast, "version") in KEYS
    assert len(KEYS) > 30
