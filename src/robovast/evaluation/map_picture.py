"""Draws the map of a configuration from data in its campaign."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from robovast.base.errors import InputError
from robovast.base.serialization import dump_yaml
from robovast.campaign.layout import CONFIGURATIONS
from robovast.evaluation.confined_files import MissingError, open_inside, read_small
from robovast.evaluation.untrusted_data import LONGEST, MOST_VALUES, mapping, parse_yaml
from robovast.model.naming import CONFIG, CONFIG_MOUNT

if TYPE_CHECKING:
    from robovast.navigation.drawing import Mark
    from robovast.navigation.occupancy import OccupancyMap

RECORD = "_navigation"
_MAP_LINE = re.compile(rf"^  {RECORD}:\n(?:    .*\n|\n)*?    (map_file: .*\n)", re.MULTILINE)
"""As `dump_yaml` writes it."""
_LARGEST_FILE = 64 << 20
_MOST_CELLS = 16_000_000


def has_map(results: Path, campaign: str, variant: str) -> bool:
    """Whether a variation type has recorded the map of a configuration."""
    return isinstance(map_record(results, campaign, variant).get("map_file"), str)


def draw_map(results: Path, campaign: str, variant: str, more: Sequence[Mark] = ()) -> str:
    """Map, start, goals, path and obstacles of a configuration as SVG, and `more` above them.

    Raises:
        InputError: it has no map, or its records cannot be drawn.
        CannotRunError: the extra `nav` is missing.
    """
    from robovast.base.optional_deps import NAV

    with NAV.needed_by("The picture of a configuration"):
        from robovast.navigation.drawing import marks, to_svg
    entry = entries(results, campaign, [variant]).get(variant, {})
    record = mapping(entry.get(RECORD))
    occupancy = read_configuration_map(results, campaign, variant, record)
    with _drawable(f"{campaign}/{variant}"):
        return to_svg(occupancy, [*marks(record, mapping(entry.get("config"))), *more], variant)


@dataclass(frozen=True)
class MapFiles:
    """A map as it is stored."""

    description: bytes
    """Content of the YAML file."""
    pixels: bytes
    """Content of the image that it names."""
    image: str
    """Its name"""


def read_map_files(
    results: Path, campaign: str, variant: str, record: Mapping[str, Any]
) -> MapFiles:
    """Read the files of a configuration's map, of which `record` was recorded.

    Raises:
        InputError: it has no map, or its files cannot be read.
    """
    name = str(record.get("map_file", "")).removeprefix(CONFIG_MOUNT)
    place = f"{campaign}/{variant}/{CONFIG}/{name}"
    try:
        content = read_small(results, place)
    except MissingError:
        place = f"{campaign}/{CONFIG}/{name}"
        content = read_small(results, place)
    image = _image_name(content)
    pixels = read_small(results, str(PurePosixPath(place).parent / image), _LARGEST_FILE)
    return MapFiles(content, pixels, image)


@lru_cache(maxsize=16)  # many configurations have equal maps
def _image_name(description: bytes) -> str:
    return str(mapping(parse_yaml(description)).get("image", ""))


def read_configuration_map(
    results: Path, campaign: str, variant: str, record: Mapping[str, Any]
) -> OccupancyMap:
    """The map of a configuration, of which `record` was recorded.

    Raises:
        InputError: it has no map, or one that cannot be read.
        CannotRunError: the extra `nav` is missing.
    """
    return decode_map(read_map_files(results, campaign, variant, record), f"{campaign}/{variant}")


def decode_map(files: MapFiles, name: str) -> OccupancyMap:
    """The map that files hold; `name` is that of its configuration in messages.

    Raises:
        InputError: it cannot be read.
        CannotRunError: the extra `nav` is missing.
    """
    from robovast.base.optional_deps import NAV

    with NAV.needed_by("The map of a configuration"):
        from robovast.navigation import occupancy
    return occupancy.decode_map(files.description, files.pixels, name, _MOST_CELLS)


@contextmanager
def _drawable(name: str) -> Iterator[None]:
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise InputError(f"{name}: its map cannot be drawn: {error}.") from None


def map_record(results: Path, campaign: str, variant: str) -> Mapping[str, Any]:
    """Records of navigation variations about a configuration; empty if there are none."""
    return mapping(entries(results, campaign, [variant]).get(variant, {}).get(RECORD))


def entries(
    results: Path, campaign: str, variants: Iterable[str]
) -> Mapping[str, Mapping[str, Any]]:
    """What a campaign has recorded of some of its configurations, by name."""
    return {name: _entry(text) for name, text in _texts(results, campaign, variants).items()}


def map_records(
    results: Path, campaign: str, variants: Iterable[str]
) -> Mapping[str, Mapping[str, Any]]:
    """Records of navigation variations about some configurations, their `map_file` alone.

    To parse one line instead of all that was recorded takes a hundredth of the time.
    """
    return {name: _map_alone(text) for name, text in _texts(results, campaign, variants).items()}


def _texts(results: Path, campaign: str, variants: Iterable[str]) -> Mapping[str, str]:
    """What is recorded of some configurations as YAML, by name; the whole file may be large."""
    wanted = {dump_yaml([{"name": variant}]): variant for variant in variants}
    lines: dict[str, list[str]] = {}
    current: list[str] | None = None
    try:
        with open_inside(results, f"{campaign}/{CONFIGURATIONS}") as file:
            text = io.TextIOWrapper(file, encoding="utf-8", errors="replace")
            for line in iter(partial(text.readline, LONGEST), ""):
                if not line.startswith(" "):
                    if current is not None and len(lines) == len(wanted):
                        break
                    name = wanted.get(line)
                    current = None if name is None else lines.setdefault(name, [])
                if current is not None and len(current) <= MOST_VALUES:
                    current.append(line)
    except MissingError:
        return {}
    return {name: "".join(part) for name, part in lines.items()}


def _entry(text: str) -> Mapping[str, Any]:
    found = parse_yaml(text.encode())
    return mapping(found[0]) if isinstance(found, list) and found else {}


def _map_alone(text: str) -> Mapping[str, Any]:
    line = _MAP_LINE.search(text)
    return mapping(_parsed_line(line[1]) if line else _entry(text).get(RECORD))


@lru_cache(maxsize=256)  # many configurations have equal maps
def _parsed_line(line: str) -> Any:
    return parse_yaml(line.encode())
