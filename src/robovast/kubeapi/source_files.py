"""The files that belong to a Campaign's document, as the API server has them."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Iterable, Mapping
from pathlib import PurePosixPath
from typing import Any

from robovast.kubeapi.resources import CampaignSpec

Files = Mapping[str, bytes]
"""Input files by path relative to the document; None if only pods can read them."""


def inline_files(spec: Mapping[str, object]) -> Files:
    """The inline files of a Campaign.

    Raises:
        ValueError: a path leaves the folder, or content is no base64.
    """
    source = CampaignSpec.model_validate(spec).source
    if source.inline is None:
        return {}
    found = {path: text.encode() for path, text in source.inline.files.items()}
    for path, data in source.inline.binary_files.items():
        try:
            found[path] = base64.b64decode(data, validate=True)
        except binascii.Error as error:
            raise ValueError(
                f"spec.source.inline.binaryFiles[{path}] is not valid base64"
            ) from error
    check_paths(found)
    return found


NAME_BYTES = 255
"""Longest name of a file or folder on common file systems [byte]."""


def check_paths(files: Iterable[str]) -> None:
    """Check that files can be written into one folder.

    Raises:
        ValueError: a path leaves the folder, is too long, or a file is a folder, too.
    """
    paths = [PurePosixPath(path) for path in files]
    for path in paths:
        if not path.parts or path.is_absolute() or ".." in path.parts or "\0" in str(path):
            raise ValueError(f"the file `{path}` leaves the document's folder; use a relative path")
        if max(len(part.encode(errors="replace")) for part in path.parts) > NAME_BYTES:
            raise ValueError(f"a name in the path `{path}` is longer than {NAME_BYTES} bytes")
    folders = {folder for path in paths for folder in path.parents}
    both = next((path for path in paths if path in folders), None)
    if both is not None:
        raise ValueError(f"`{both}` is a file, and a folder of other files; rename one of them")
    if len(set(paths)) < len(paths):
        raise ValueError("two of the files have one path, spelt in two ways")


def config_map_files(config_map: Mapping[str, Any], paths: Mapping[str, str]) -> Files:
    """The files in a ConfigMap.

    Args:
        config_map: the object.
        paths: file by key; without any, each key is a file name.
    """
    found = {key: text.encode() for key, text in (config_map.get("data") or {}).items()}
    for key, data in (config_map.get("binaryData") or {}).items():
        found[key] = base64.b64decode(data)
    return {paths[k]: v for k, v in found.items() if k in paths} if paths else found
