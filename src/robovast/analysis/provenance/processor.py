"""The base class of metadata processors."""

from __future__ import annotations

from pathlib import Path
from typing import Any


class MetadataProcessor:
    """Completes or changes the metadata of a campaign before it is written.

    The parameters of the .vast file are given to the constructor by name; without a constructor
    of its own a subclass finds them as attributes.
    """

    def __init__(self, **parameters: Any) -> None:
        for name, value in parameters.items():
            setattr(self, name, value)

    def process_metadata(self, metadata: dict[str, Any], campaign_dir: Path) -> dict[str, Any]:
        """The metadata to write.

        Args:
            metadata: content of metadata.yaml so far; may be changed in place.
            campaign_dir: the campaign's folder.
        """
        raise NotImplementedError(f"{type(self).__name__} does not implement `process_metadata`")
