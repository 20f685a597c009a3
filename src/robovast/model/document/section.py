"""What all sections of a .vast document share: their base, plugins and pairs."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticCustomError

from robovast.base import docstrings
from robovast.model.strict_numbers import StrictNumbers


class Section(StrictNumbers):
    """A mapping of known keys; a key without a value counts as absent."""

    model_config = ConfigDict(
        extra="forbid",
        use_attribute_docstrings=docstrings.READ,
        frozen=True,
        defer_build=True,
    )

    @model_validator(mode="before")
    @classmethod
    def _without_empty_keys(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        optional = {name for name, field in cls.model_fields.items() if not field.is_required()}
        return {key: v for key, v in value.items() if v is not None or key not in optional}


class PluginCall(BaseModel):
    """A plugin by name, with its parameters: `name` or `name: {parameter: value}`."""

    model_config = ConfigDict(frozen=True, defer_build=True)

    name: str
    parameters: dict[str, Any] = Field(default_factory=dict)


def _parse_plugin_call(value: Any) -> Any:
    if isinstance(value, PluginCall):
        return value
    if isinstance(value, str):
        return PluginCall(name=value)
    if isinstance(value, dict) and len(value) == 1:
        ((name, parameters),) = value.items()
        if isinstance(name, str) and (parameters is None or isinstance(parameters, dict)):
            return PluginCall(name=name, parameters=parameters or {})
    if isinstance(value, dict) and len(value) > 1 and next(iter(value.values())) is None:
        raise PydanticCustomError(
            "plugin_indent",
            "the parameters of `{name}` must be indented further than its name",
            {"name": next(iter(value))},
        )
    raise PydanticCustomError(
        "plugin_call", "must be a plugin's name, or one name with a mapping of its parameters"
    )


def _parse_pair(value: Any) -> Any:
    if isinstance(value, dict) and value and all(isinstance(name, str) for name in value):
        return value
    raise PydanticCustomError("pair", "must be a `name: value` pair")


Plugin = Annotated[
    PluginCall,
    BeforeValidator(_parse_plugin_call),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string"},
                {
                    "type": "object",
                    "minProperties": 1,
                    "maxProperties": 1,
                    "additionalProperties": {"type": ["object", "null"]},
                },
            ]
        }
    ),
]

Pair = Annotated[
    dict[str, Any],
    BeforeValidator(_parse_pair),
    WithJsonSchema({"type": "object", "minProperties": 1}),
]


def merge_pairs(pairs: list[dict[str, Any]]) -> dict[str, Any]:
    """Merge `name: value` pairs into a mapping; the last value of a repeated name wins."""
    return {name: value for pair in pairs for name, value in pair.items()}
