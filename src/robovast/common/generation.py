"""Expansion of documents to plain dicts, for plugins and scripts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import mkdtemp
from typing import Any


def generate_scenario_variations(
    variation_file: str | Path,
    progress_update_callback: Callable[[str], None] | None = None,
    variation_classes: Mapping[str, Any] | None = None,
    output_dir: str | Path | None = None,
    use_cache: bool = True,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Expand a .vast file.

    Args:
        variation_file: the .vast file.
        progress_update_callback: receives the messages of variation types.
        variation_classes: must be None; variation types are found by their names in the file.
        output_dir: folder for generated files; None makes a new temporary folder.
        use_cache: has no effect; every call expands anew.

    Returns:
        The campaign, with its `configs` (`name`, `config`, `_config_files`, `_config_name`,
        `_variations` and additions of plugins), and the `GUI_CLASS` of variation types, by name.

    Raises:
        InputError: the file is invalid.
        ValueError: `variation_classes` is given.
    """
    del use_cache
    if variation_classes is not None:
        raise ValueError(
            "variation types are found by the names in the .vast file: an entry point of the "
            "group robovast.variation_types, or `<path>.py:<Class>`"
        )
    from robovast.model.document import load_document
    from robovast.model.expansion import Variant, expand
    from robovast.model.variations.factors import FACTORS
    from robovast.model.variations.loader import load_variation

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
            **({FACTORS: dict(variant.factors)} if variant.factors else {}),
            **variant.extra,
        }

    campaign = {
        "vast": document.path.name,
        "scenario_file": document.vast.scenario_file,
        "configs": [as_dict(variant) for variant in variants],
    }
    names = {record.name for variant in variants for record in variant.variations}
    kinds = {name: load_variation(name, document.folder) for name in sorted(names)}
    return campaign, {n: kind.GUI_CLASS for n, kind in kinds.items() if kind.GUI_CLASS is not None}
