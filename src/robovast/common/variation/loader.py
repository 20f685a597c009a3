"""Finding a variation type by name."""

from __future__ import annotations

from pathlib import Path

from robovast.common.variation.base_variation import Variation
from robovast.errors import InputError
from robovast.plugins import load_plugin

GROUP = "robovast.variation_types"


def load_variation(name: str, folder: str | Path) -> type[Variation]:
    """The class of a variation type.

    Args:
        name: an entry-point name, or `<path>.py:<Class>`.
        folder: the .vast file's folder.

    Raises:
        InputError: there is none, it cannot be loaded, or it is no variation type.
    """
    found = load_plugin(name, GROUP, folder)
    if not (isinstance(found, type) and issubclass(found, Variation)):
        raise InputError(
            f"`{name}` is no variation type: it must be a class that inherits from "
            "robovast.common.variation.Variation"
        )
    return found
