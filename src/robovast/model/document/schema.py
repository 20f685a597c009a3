"""The JSON schema of .vast files, for completion and checks in editors."""

from __future__ import annotations

import json
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema

from robovast.model.document.model import Vast
from robovast.model.variations import BUILT_IN_TYPES, Variation

DIALECT = "https://json-schema.org/draft/2020-12/schema"


class _Schema(GenerateJsonSchema):
    """Omits titles, which would only repeat the keys."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        """Never."""
        del schema
        return False


def document_schema() -> dict[str, Any]:
    """JSON Schema of a .vast file, the parameters of built-in variation types included."""
    schema = _model_schema(Vast)
    definitions: dict[str, Any] = schema.pop("$defs")
    definitions["Variation"] = _variation(definitions)
    entry = definitions["ConfigurationEntry"]["properties"]["variations"]
    for option in entry["anyOf"]:
        if option.get("type") == "array":
            option["items"] = {"$ref": "#/$defs/Variation"}
    return {
        "$schema": DIALECT,
        "title": "RoboVAST configuration (.vast)",
        **schema,
        "$defs": dict(sorted(definitions.items())),
    }


def schema_text() -> str:
    """The content of `schemas/vast.schema.json`."""
    return json.dumps(document_schema(), indent=2, ensure_ascii=False) + "\n"


def _model_schema(model: type[BaseModel]) -> dict[str, Any]:
    schema = model.model_json_schema(schema_generator=_Schema)
    for definition in (schema, *schema.get("$defs", {}).values()):
        definition.pop("title", None)
    return schema


def _variation(definitions: dict[str, Any]) -> dict[str, Any]:
    """Schema of a variation: a name, or a name with parameters (any, for types of plugins)."""
    known = {}
    for variation in BUILT_IN_TYPES:
        schema = _parameters(variation, definitions)
        summary = (variation.__doc__ or "").strip().partition("\n")[0]
        known[variation.__name__] = {"description": summary, **schema} if summary else schema
    return {
        "description": "A variation type, built in or of a plugin, with its parameters.",
        "anyOf": [
            {"type": "string"},
            {
                "type": "object",
                "minProperties": 1,
                "maxProperties": 1,
                "properties": known,
                "additionalProperties": {"type": ["object", "null"]},
            },
        ],
    }


def _parameters(variation: type[Variation], definitions: dict[str, Any]) -> dict[str, Any]:
    model: type[BaseModel] | None = variation.CONFIG_CLASS
    if model is None:
        return {"type": "object"}
    schema = _model_schema(model)
    definitions.update(schema.pop("$defs", {}))
    schema.pop("description", None)
    return schema
