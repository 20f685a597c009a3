"""Which Secrets a Campaign may name: only those that were made for campaigns.

Users who may create Campaigns may lack the permission to read Secrets, but the author of a Campaign
can read the files that its pods mount, with plugins or an S3 address. So a Secret opts in by its
name. The API server rejects other Secrets (a rule at each such field), and the operator creates no
pods for Campaigns that were stored without that rule.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from typing import Any, get_args

from pydantic import BaseModel, GetJsonSchemaHandler
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema

SECRET_PREFIX = "robovast-"  # noqa: S105 - a prefix of names

ALLOWED_BESIDE = "self in []"
"""Part of the rule that the chart replaces by the names that an administrator allows."""

REMEDY = (
    f"a Campaign may use only Secrets for campaigns: their names begin with `{SECRET_PREFIX}`, or "
    "your cluster administrator allows the names (chart value `policies.secretNames`)"
)


class _MadeForCampaigns:
    """Marks a field that names a Secret."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the schema of the field with the rule that the API server enforces."""
        rule = f"self.startsWith('{SECRET_PREFIX}') || {ALLOWED_BESIDE}"
        rules = [{"rule": rule, "message": REMEDY}]
        return {**handler(schema), "x-kubernetes-validations": rules}


MADE_FOR_CAMPAIGNS = _MadeForCampaigns()


def may_be_named(name: str, allowed: Container[str]) -> bool:
    """Return whether a Campaign may use a Secret.

    Args:
        name: of the Secret.
        allowed: names without the prefix.
    """
    return name.startswith(SECRET_PREFIX) or name in allowed


def refusal(spec: BaseModel, allowed: Container[str]) -> str:
    """Return the error about forbidden Secrets in a spec; empty if there are none.

    Args:
        spec: of a Campaign, or a part of a spec.
        allowed: names without the prefix.
    """
    named = ", ".join(f"{at} names `{name}`" for at, name in _foreign(spec, allowed))
    return named and f"{named}: {REMEDY}"


def _foreign(spec: BaseModel, allowed: Container[str]) -> Iterator[tuple[str, str]]:
    """Generate the keys and names of forbidden Secrets in a spec."""
    for name, field in type(spec).model_fields.items():
        value, place = getattr(spec, name), field.alias or name
        named = value is not None and MADE_FOR_CAMPAIGNS in _marks(field)
        if named and not may_be_named(value, allowed):
            yield place, value
        for key, part in _parts(value):
            yield from ((f"{place}{key}.{at}", bad) for at, bad in _foreign(part, allowed))


def _marks(field: FieldInfo) -> Iterator[object]:
    """Generate the metadata of the annotation of a field, also inside `… | None`."""
    yield from field.metadata
    for alternative in get_args(field.annotation):
        yield from getattr(alternative, "__metadata__", ())


def _parts(value: object) -> Iterator[tuple[str, BaseModel]]:
    """Generate the models in the value of a field, with their positions."""
    if isinstance(value, BaseModel):
        yield "", value
    elif isinstance(value, Sequence):
        parts = enumerate(value)
        yield from ((f"[{i}]", part) for i, part in parts if isinstance(part, BaseModel))
