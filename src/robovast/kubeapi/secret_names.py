"""Which Secrets a Campaign may name: only those that were made for campaigns.

Whoever may make Campaigns need not be allowed to read Secrets, but pods of a Campaign hand what
they mount to its author: to an address of theirs, or to their plugins. So a Secret opts in by its
name. The API server refuses others (a rule at every field of this kind), and the operator makes no
pod with what was stored before there was that rule.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from typing import Any, get_args

from pydantic import BaseModel, GetJsonSchemaHandler
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema

SECRET_PREFIX = "robovast-"  # noqa: S105 - what names of Secrets begin with

ALLOWED_BESIDE = "self in []"
"""What the chart replaces in the rule where an administrator allows other names."""

REMEDY = (
    f"a Campaign may name only Secrets that are meant for campaigns: their names begin with "
    f"`{SECRET_PREFIX}`, or are allowed by whoever keeps the cluster (chart value "
    "`policies.secretNames`)"
)


class _MadeForCampaigns:
    """Marks a field that names a Secret."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """The field's schema with the rule that an API server keeps."""
        rule = f"self.startsWith('{SECRET_PREFIX}') || {ALLOWED_BESIDE}"
        rules = [{"rule": rule, "message": REMEDY}]
        return {**handler(schema), "x-kubernetes-validations": rules}


MADE_FOR_CAMPAIGNS = _MadeForCampaigns()


def may_be_named(name: str, allowed: Container[str]) -> bool:
    """Whether a Campaign may name a Secret.

    Args:
        name: of the Secret.
        allowed: names beside those with the prefix.
    """
    return name.startswith(SECRET_PREFIX) or name in allowed


def refusal(spec: BaseModel, allowed: Container[str]) -> str:
    """The refusal of a spec that names forbidden Secrets; empty if it names none.

    Args:
        spec: of a Campaign, or a part of one.
        allowed: names beside those with the prefix.
    """
    named = ", ".join(f"{at} names `{name}`" for at, name in _foreign(spec, allowed))
    return named and f"{named}: {REMEDY}"


def _foreign(spec: BaseModel, allowed: Container[str]) -> Iterator[tuple[str, str]]:
    """The places and names of forbidden Secrets in a spec."""
    for name, field in type(spec).model_fields.items():
        value, place = getattr(spec, name), field.alias or name
        named = value is not None and MADE_FOR_CAMPAIGNS in _marks(field)
        if named and not may_be_named(value, allowed):
            yield place, value
        for key, part in _parts(value):
            yield from ((f"{place}{key}.{at}", bad) for at, bad in _foreign(part, allowed))


def _marks(field: FieldInfo) -> Iterator[object]:
    """The metadata of a field's annotation; `… | None` keeps it inside."""
    yield from field.metadata
    for alternative in get_args(field.annotation):
        yield from getattr(alternative, "__metadata__", ())


def _parts(value: object) -> Iterator[tuple[str, BaseModel]]:
    """The models in a field's value, with their places."""
    if isinstance(value, BaseModel):
        yield "", value
    elif isinstance(value, Sequence):
        parts = enumerate(value)
        yield from ((f"[{i}]", part) for i, part in parts if isinstance(part, BaseModel))
