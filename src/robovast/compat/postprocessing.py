"""The base class of postprocessing commands."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any


class BasePostprocessingPlugin(ABC):
    """A postprocessing command as a class (docs/reference/postprocessing.md)."""

    @abstractmethod
    def __call__(self, results_dir: str, config_dir: str, **kwargs: Any) -> Sequence[Any]:
        """Process a campaign.

        Args:
            results_dir: folder of the campaign.
            config_dir: folder of the .vast file.
            kwargs: parameters in the .vast file, and `provenance_file`.

        Returns:
            Whether it succeeded, a message, and provenance entries, if there are any.
        """

    def get_files_to_copy(self, config_dir: str, params: dict[str, Any]) -> list[str]:
        """Additional files to copy to the campaign's `_config` folder."""
        del config_dir, params
        return []
