"""The base class of metadata processors."""

from __future__ import annotations

from pathlib import Path
from typing import Any


class MetadataProcessor:
    """Base class of plugins that add to or change a campaign's metadata before it is written.

    The parameters in the .vast file are passed to the constructor by name; without its own
    constructor, a subclass finds them as attributes.
    """

    def __init__(self, **parameters: Any) -> None:
        for name, value in parameters.items():
            setattr(self, name, value)

    def process_metadata(self, metadata: dict[str, Any], campaign_dir: Path) -> dict[str, Any]:
        """Return the metadata to write.

        Args:
            metadata: current content of metadata.yaml; may be changed in place.
            campaign_dir: the campaign's folder.
        """
        raise NotImplementedError(f"{type(self).__name__} does not implement `process_metadata`")
