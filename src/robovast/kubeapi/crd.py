"""The CRDs, generated from the models of the document, of the specs and of the status.

A structural schema has no references and one type at each position. If a value may have several
types, the schema accepts any value, and the operator reports invalid values.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from robovast.base.serialization import dump_yaml
from robovast.kubeapi.names import CAMPAIGN_NAME_LIMIT, CAMPAIGN_NAME_RULE
from robovast.kubeapi.resources import (
    COMPARED_VALUES,
    GROUP,
    ONE_ADDRESS,
    VERSION,
    CampaignSpec,
    ConfigurationSpec,
)
from robovast.kubeapi.status import CampaignStatus, ConfigurationStatus
from robovast.model.document.model import Vast

Schema = dict[str, Any]

ANYTHING: Schema = {"x-kubernetes-preserve-unknown-fields": True}

_KEPT = (
    "type", "format", "enum", "pattern", "minimum", "maximum", "minLength", "maxLength",
    "minItems", "maxItems", "minProperties", "maxProperties", "required",
    "x-kubernetes-validations",
)  # fmt: skip


def campaign_crd() -> Schema:
    """Return the CRD of Campaign."""
    spec = structural(CampaignSpec)
    spec["properties"]["vast"] = _vast_schema()
    spec["x-kubernetes-validations"] = [
        _never_changes("document"),
        _never_changes("source"),
        _never_changes("select"),
        _never_changes("storage"),
        _never_changes("image"),
        {
            "rule": "!has(oldSelf.runs) || (has(self.runs) && self.runs >= oldSelf.runs)",
            "message": "`runs` can only be raised, because stored results are never removed",
            "fieldPath": ".runs",
        },
        {
            "rule": "self.attempt >= oldSelf.attempt && self.attempt <= oldSelf.attempt + 1",
            "message": "`attempt` can only be increased by one",
            "fieldPath": ".attempt",
        },
    ]
    sources = list(spec["properties"]["source"]["properties"])
    named = ", ".join(f"has(self.{name})" for name in sources)
    spec["properties"]["source"]["x-kubernetes-validations"] = [
        {
            "rule": f"[{named}].filter(x, x).size() <= 1",
            "message": f"`source` must have at most one of {', '.join(sources)}",
            "fieldPath": f".{sources[0]}",
        }
    ]
    spec["properties"]["notifications"]["items"]["x-kubernetes-validations"] = [
        {
            "rule": "has(self.url) != has(self.urlFrom)",
            "message": ONE_ADDRESS,
            "fieldPath": ".url",
        }
    ]
    compared = {
        "rule": "(self.operator in ['Exists', 'DoesNotExist']) == "
        "(!has(self.values) || self.values.size() == 0)",
        "message": COMPARED_VALUES,
        "fieldPath": ".values",
    }
    nodes = spec["properties"]["scheduling"]["properties"]["nodeAffinity"]["properties"]
    for kind in ("required", "preferred"):
        nodes[kind]["items"]["x-kubernetes-validations"] = [compared]
    return _crd(
        kind="Campaign",
        short_names=["vcamp"],
        description="A .vast file that runs on this cluster.",
        spec=spec,
        status=_without_defaults(structural(CampaignStatus)),
        columns=[
            _column("State", "string", ".status.state"),
            _column("Progress", "string", ".status.progress"),
            _column("Active", "integer", ".status.runs.active"),
            _column("Waiting", "integer", ".status.runs.waiting"),
            _column("Passed", "integer", ".status.runs.passed"),
            _column("Failed", "integer", ".status.runs.failed"),
            _column("Errored", "integer", ".status.runs.errored"),
            _column("Verdict", "string", '.status.conditions[?(@.type=="Passed")].status'),
            _column("Age", "date", ".metadata.creationTimestamp"),
            _column("Not needed", "integer", ".status.runs.notNeeded", wide=True),
            _column("Decisions", "string", ".status.decisions", wide=True),
            _column("Batches", "integer", ".status.search.batch", wide=True),
            _column("Best", "string", ".status.search.best", wide=True),
            _column("Queue", "string", ".spec.queueName", wide=True),
            _column("Place", "string", ".status.queue.summary", wide=True),
            _column("Ends", "string", ".status.estimate.end", wide=True),
            _column("Results", "string", ".status.bucket", wide=True),
            _column(
                "Reason", "string", '.status.conditions[?(@.type=="Reconciling")].reason', wide=True
            ),
        ],
        selectable=[".spec.queueName", ".status.state"],
        rules=[
            {
                "rule": f"self.metadata.name.size() <= {CAMPAIGN_NAME_LIMIT} "
                "&& !self.metadata.name.contains('.')",
                "message": CAMPAIGN_NAME_RULE,
                "fieldPath": ".metadata.name",
            },
            {
                "rule": "!has(self.spec.runs) || !has(self.status) "
                "|| !has(self.status.runsPerConfiguration) "
                "|| self.spec.runs >= self.status.runsPerConfiguration",
                "message": "`runs` can only be raised: `status.runsPerConfiguration` is the "
                "number of planned runs",
                "fieldPath": ".spec.runs",
            },
        ],
    )


def configuration_crd() -> Schema:
    """Return the CRD of Configuration."""
    spec = structural(ConfigurationSpec)
    entry = _vast_schema()["properties"]["configuration"]["items"]["properties"]
    for name in ("parameters", "variations"):
        spec["properties"][name] |= {"items": entry[name]["items"]}
    spec["properties"]["design"] = entry["design"]
    spec["x-kubernetes-validations"] = [_never_changes(name) for name in ("campaign", "name")]
    return _crd(
        kind="Configuration",
        short_names=["vconf"],
        description="A configuration entry of a Campaign, or additional runs that a user applies.",
        spec=spec,
        status=_without_defaults(structural(ConfigurationStatus)),
        columns=[
            _column("Campaign", "string", ".spec.campaign"),
            _column("Variants", "integer", ".status.variants"),
            _column("Progress", "string", ".status.progress"),
            _column("Passed", "integer", ".status.runs.passed"),
            _column("Failed", "integer", ".status.runs.failed"),
            _column("Errored", "integer", ".status.runs.errored"),
            _column("Age", "date", ".metadata.creationTimestamp"),
        ],
        selectable=[".spec.campaign"],
        rules=[],
    )


def campaign_crd_text() -> str:
    """Return the content of crds/campaign.yaml."""
    return dump_yaml(campaign_crd())


def configuration_crd_text() -> str:
    """Return the content of crds/configuration.yaml."""
    return dump_yaml(configuration_crd())


def structural(model: type[BaseModel]) -> Schema:
    """Return a model as a structural schema."""
    schema = model.model_json_schema(by_alias=True)
    return _structural(schema, schema.get("$defs", {}))


def _vast_schema() -> Schema:
    vast: Schema = _maybe_empty(_without_defaults(structural(Vast)))
    properties = vast["properties"]
    properties["metadata"] = {
        "type": "object",
        **ANYTHING,
        "description": properties["metadata"]["description"],
    }
    entries = properties["configuration"]
    entries |= {"x-kubernetes-list-type": "map", "x-kubernetes-list-map-keys": ["name"]}
    vast["x-kubernetes-validations"] = [
        {
            "rule": "!(has(self.search) && has(self.configuration))",
            "message": "a .vast file has either `search` or `configuration`, not both",
            "fieldPath": ".search",
        }
    ]
    return vast


def _maybe_empty(schema: Schema) -> Schema:
    """Allow sections and lists without a value, as in a file."""
    required = schema.get("required", ())
    for name, inner in schema.get("properties", {}).items():
        if inner.get("type") in {"object", "array"} and name not in required:
            inner["nullable"] = True
        _maybe_empty(inner)
    if isinstance(schema.get("items"), dict):
        _maybe_empty(schema["items"])
    return schema


def _without_defaults(schema: Any) -> Any:
    """Remove defaults, so that the API server does not change the .vast file of a user."""
    if isinstance(schema, list):
        return [_without_defaults(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    return {
        key: _without_defaults(value)
        for key, value in schema.items()
        if key != "default" or isinstance(value, dict)
    }


def _structural(schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> Schema:
    """Remove references, alternatives and defaults of empty values from a schema."""
    if "$ref" in schema:
        target = definitions[schema["$ref"].removeprefix("#/$defs/")]
        merged = {**target, **{k: v for k, v in schema.items() if k != "$ref"}}
        return _structural(merged, definitions)
    if "anyOf" in schema:
        return _alternatives(schema, definitions)
    made: Schema = {key: schema[key] for key in _KEPT if key in schema}
    if "description" in schema:
        made["description"] = " ".join(schema["description"].split())
    if "const" in schema:
        made["enum"] = [schema["const"]]
    if "exclusiveMinimum" in schema:
        made |= {"minimum": schema["exclusiveMinimum"], "exclusiveMinimum": True}
    if isinstance(schema.get("default"), int | str) and schema["default"] != "":
        made["default"] = schema["default"]
    made |= _children(schema, definitions)
    return made if "type" in made else made | ANYTHING


def _children(schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> Schema:
    made: Schema = {}
    if schema.get("type") == "array":
        made["items"] = _structural(schema.get("items") or {}, definitions)
    elif "properties" in schema:
        items = schema["properties"].items()
        made["properties"] = {name: _structural(value, definitions) for name, value in items}
    elif schema.get("type") == "object":
        values = schema.get("additionalProperties")
        if isinstance(values, dict) and values:
            made["additionalProperties"] = _structural(values, definitions)
        else:
            made |= ANYTHING
    return made


def _alternatives(schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> Schema:
    """Replace `anyOf`: keep a single alternative to null; accept any value if there are several."""
    options = [option for option in schema["anyOf"] if option.get("type") != "null"]
    rest = {key: value for key, value in schema.items() if key not in {"anyOf", "default"}}
    if len(options) == 1:
        made = _structural({**options[0], **rest}, definitions)
        return made if len(options) == len(schema["anyOf"]) else made | {"nullable": True}
    return _structural(rest, definitions)


def _never_changes(name: str) -> Schema:
    return {
        "rule": f"has(self.{name}) == has(oldSelf.{name}) && "
        f"(!has(self.{name}) || self.{name} == oldSelf.{name})",
        "message": f"`{name}` cannot be changed: create another Campaign",
        "fieldPath": f".{name}",
    }


def _column(name: str, kind: str, path: str, *, wide: bool = False) -> Schema:
    column: Schema = {"name": name, "type": kind, "jsonPath": path}
    return column | {"priority": 1} if wide else column


def _crd(
    *,
    kind: str,
    short_names: list[str],
    description: str,
    spec: Schema,
    status: Schema,
    columns: list[Schema],
    selectable: list[str],
    rules: list[Schema],
) -> Schema:
    plural = f"{kind.lower()}s"
    schema: Schema = {
        "type": "object",
        "description": description,
        "required": ["spec"],
        "properties": {
            "apiVersion": {"type": "string"},
            "kind": {"type": "string"},
            "metadata": {"type": "object", "properties": {"name": {"type": "string"}}},
            "spec": spec,
            "status": status,
        },
    }
    if rules:
        schema["x-kubernetes-validations"] = rules
    return {
        "apiVersion": "apiextensions.k8s.io/v1",
        "kind": "CustomResourceDefinition",
        "metadata": {"name": f"{plural}.{GROUP}"},
        "spec": {
            "group": GROUP,
            "scope": "Namespaced",
            "names": {
                "kind": kind,
                "listKind": f"{kind}List",
                "plural": plural,
                "singular": kind.lower(),
                "shortNames": short_names,
                "categories": ["robovast"],
            },
            "versions": [
                {
                    "name": VERSION,
                    "served": True,
                    "storage": True,
                    "subresources": {"status": {}},
                    "additionalPrinterColumns": columns,
                    "selectableFields": [{"jsonPath": path} for path in selectable],
                    "schema": {"openAPIV3Schema": schema},
                }
            ],
        },
    }
