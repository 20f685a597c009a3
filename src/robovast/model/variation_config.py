"""Parameter models of variation types, and messages about wrong parameters."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import AliasChoices, BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from robovast.base import docstrings
from robovast.base.errors import InputError, one_of
from robovast.model.strict_numbers import StrictNumbers

ConfigT = TypeVar("ConfigT", bound=BaseModel)


class VariationConfig(StrictNumbers):
    """Base class of parameter models of variation types; unknown parameters have no effect."""

    model_config = ConfigDict(
        extra="ignore", use_attribute_docstrings=docstrings.READ, defer_build=True
    )


def get_validated_config(parameters: Any, config_class: type[ConfigT]) -> ConfigT:
    """Validate the parameters of a variation type.

    Raises:
        ValueError: a parameter is invalid; the message names it and says what is allowed.
    """
    given = parameters if parameters is not None else {}
    for key, near in unknown_parameters(given, config_class).items():
        if near is not None:
            raise ValueError(f"unknown parameter `{key}` (did you mean `{near}`?)")
    try:
        return config_class.model_validate(given)
    except ValidationError as error:
        lines = [_explain(details, config_class) for details in error.errors(include_url=False)]
        raise ValueError("; ".join(lines)) from error


def unknown_parameters(parameters: Any, config_class: type[BaseModel]) -> dict[str, str | None]:
    """Parameters that a model ignores, each with the similar known name, or None."""
    if config_class.model_config.get("extra") != "ignore" or not isinstance(parameters, dict):
        return {}
    known = {name for field in config_class.model_fields.items() for name in _names(*field)}
    unknown = (str(key) for key in parameters if key not in known)
    return {key: next(iter(_similar(key, known)), None) for key in unknown}


def _similar(key: str, known: Iterable[str]) -> list[str]:
    """The most similar known name, if there is any."""
    from difflib import get_close_matches  # hardly ever needed, and pods start with this module

    return get_close_matches(key, known, n=1)


def _names(name: str, field: FieldInfo) -> list[str]:
    """The field's name and its aliases."""
    alias = field.validation_alias
    return [name, *(map(str, alias.choices) if isinstance(alias, AliasChoices) else ())]


def _explain(details: Any, config_class: type[BaseModel]) -> str:
    from robovast.model.document.problems import sentence

    key = ".".join(str(part) for part in details["loc"])
    known = sorted(config_class.model_fields)
    if details["type"] == "missing":
        return f"the parameter `{key}` is missing"
    if details["type"] == "extra_forbidden":
        near = _similar(key, known)
        hint = f"did you mean `{near[0]}`?" if near else f"known: {', '.join(known)}"
        return f"unknown parameter `{key}` ({hint})"
    return f"`{key}` {sentence(details)}"


_MARKER = re.compile(r"^\$(?:\{(?P<braced>[A-Za-z_]\w*)\}|(?P<plain>[A-Za-z_]\w*))$")


def match_var_marker(value: Any) -> str | None:
    """The name in a `$name` or `${name}` marker, or None when that is not the whole value."""
    match = _MARKER.match(value) if isinstance(value, str) else None
    return (match["braced"] or match["plain"]) if match else None


def normalize_secondary_containers(containers: Sequence[Any] | None) -> list[dict[str, Any]]:
    """Convert `["nav", {"sim": {"resources": …}}, {"sim": None, "resources": …}]` to mappings.

    Returns:
        A `{name, resources}` mapping for each container.
    """
    result = []
    for item in containers or []:
        settings = {item: None} if isinstance(item, str) else item
        name = next(key for key in settings if key != "resources")
        inside = {**(settings[name] or {}), **settings}
        result.append({"name": name, "resources": dict(inside.get("resources") or {})})
    return result


def load_config(
    config_file: str | Path, subsection: str | None = None, allow_missing: bool = False
) -> dict[str, Any]:
    """The content of a .vast file or of one section.

    Args:
        config_file: the .vast file.
        subsection: name of the section; None for the whole file.
        allow_missing: return {} for a missing section.

    Raises:
        InputError: the file cannot be read, or has no such section.
        DocumentError: it is not valid YAML.
    """
    from robovast.model.document.source import Source

    data = Source.read(Path(config_file)).data or {}
    if subsection is None:
        return dict(data)
    if subsection not in data and not allow_missing:
        raise InputError(
            f"{config_file}: there is no section `{subsection}`",
            hint=one_of(data, f"add the section `{subsection}`"),
        )
    return dict(data.get(subsection) or {})


def filter_configs(configs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Configurations without their internal keys, which begin with `_`."""
    return [
        {key: value for key, value in config.items() if not key.startswith("_")}
        for config in configs
    ]


def convert_dataclasses_to_dict(obj: Any) -> Any:
    """A copy in which all dataclasses, at any depth of mappings and lists, are dicts."""
    if is_dataclass(obj) and not isinstance(obj, type):
        return {f.name: convert_dataclasses_to_dict(getattr(obj, f.name)) for f in fields(obj)}
    if isinstance(obj, dict):
        return {key: convert_dataclasses_to_dict(value) for key, value in obj.items()}
    if isinstance(obj, list | tuple):
        return [convert_dataclasses_to_dict(item) for item in obj]
    return obj
