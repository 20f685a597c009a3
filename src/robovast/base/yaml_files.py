"""Reading the YAML files of a campaign, each of which holds a mapping."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from robovast.base.errors import InputError
from robovast.base.safe_paths import MOST_OF_ALL, read_file

try:
    from yaml import CSafeLoader as _Loader
except ImportError:  # PyYAML built without libyaml: slower, same result
    from yaml import SafeLoader as _Loader  # type: ignore[assignment]


def read_mapping(path: Path) -> dict[str, Any]:
    """Content of a YAML file; empty when there is no such file, or it holds no mapping.

    Raises:
        InputError: it cannot be read.
    """
    try:
        data = yaml.load(read_file(path, most=MOST_OF_ALL).decode(), Loader=_Loader)  # safe
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    return data if isinstance(data, dict) else {}
