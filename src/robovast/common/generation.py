"""Expansion for plugins and scripts, as plain dicts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import mkdtemp
from typing import Any


def generate_scenario_variations(
    variation_file: str | Path,
    progress_update_callback: Callable[[str], None] | None = None,
    output_dir: str | Path | None = None,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Expand a .vast file.

    Args:
        variation_file: the .vast file.
        progress_update_callback: receives the messages of variation types.
        output_dir: folder for generated files; a new temporary one when None.

    Returns:
        The configurations (`name`, `config`, `_config_files`, `_config_name`, `_variations` and
        what plugins added), and every variation that was applied (`name`, `started_at`,
        `duration` in seconds).

    Raises:
        InputError: the file is wrong.
    """
    from robovast.document import load_document
    from robovast.expansion import Variant, expand

    document = load_document(Path(variation_file))
    folder = Path(output_dir or mkdtemp(prefix="robovast-"))
    variants = expand(document, folder, progress_update_callback)

    def as_dict(variant: Variant) -> dict[str, Any]:
        return {
            "name": variant.name,
            "config": dict(variant.parameters),
            "_config_name": variant.entry,
            "_config_files": [(file.name, str(file.source)) for file in variant.files],
            "_variations": [
                {"name": r.name, "started_at": r.started_at, "duration": r.duration}
                for r in variant.variations
            ],
            **variant.extra,
        }

    configs = [as_dict(variant) for variant in variants]
    applied = {repr(record): record for config in configs for record in config["_variations"]}
    return configs, list(applied.values())
