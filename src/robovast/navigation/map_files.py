"""Reads the files of a map: the YAML description and the image, as Nav2's map_server does.

| key | value | default |
| --- | --- | --- |
| `image` | path of the image, relative to the YAML file | required |
| `resolution` | edge length of a cell, above 0 [m] | required |
| `origin` | `[x, y, yaw]` of the lower left corner [m, rad]; the yaw must be 0 | `[0, 0, 0]` |
| `mode` | `trinary`, `scale` or `raw`, in any letter case | `trinary` |
| `negate` | a whole number, or a truth value of YAML 1.1 such as `true` or `off` | 0 |
| `occupied_thresh` | from 0 to 1, at least `free_thresh` | 0.65 |
| `free_thresh` | from 0 to 1 | 0.196 |

Other keys have no effect, unless they are misspelled ones of the table. A key occurs once. Numbers
are decimal, also with an exponent (`5e-2`) or in quotes.

| image | pixels |
| --- | --- |
| PGM, PPM, PBM | text or binary, largest value 1 to 65,535 |
| PNG | 1 to 16 bits, grey, color or palette, with or without transparency |
| BMP, JPEG, TIFF | 1 or 8 bits, grey, color or palette; TIFF also 16 bits of grey; one page |

Values are scaled by the largest value that the format declares, to 8 bits. Color becomes grey by
its luma (Rec. 709). TIFF samples are unsigned, with orientation 1. At most `MOST_CELLS` pixels are
read.
"""

from __future__ import annotations

import difflib
import io
import math
import re
import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml
from PIL import Image, UnidentifiedImageError
from PIL.ExifTags import Base
from PIL.TiffImagePlugin import TiffImageFile

from robovast.base.errors import InputError
from robovast.base.file_errors import cause
from robovast.base.safe_paths import read_file
from robovast.base.yaml_files import compose_yaml

Grid = npt.NDArray[np.int8]
"""Rows from top to bottom. 0 is free, 100 is occupied, -1 is unknown, others are in between."""

MOST_CELLS = 64_000_000
"""Most cells of a map, such as 8,000 × 8,000."""
_LARGEST_DESCRIPTION = 1 << 20
"""Largest YAML file [bytes]."""
_LARGEST_IMAGE = 512 << 20
"""Largest image file [bytes]."""
_FORMATS = ("PPM", "PNG", "BMP", "JPEG", "TIFF")
"""Formats by Pillow's names; PPM includes PGM and PBM."""
_EIGHT_BITS = frozenset({"1", "L", "LA", "P", "PA", "RGB", "RGBA"})
_SIXTEEN_BITS = frozenset({"I", "I;16", "I;16B", "I;16L"})
"""Pillow's modes. Its `I` has 16 bits in PGM and PNG, and 32 in TIFF."""
_LUMA = (0.212656, 0.715158, 0.072186, 0.0)
_OPAQUE = 255
_PNG_BITS = 24
"""Byte of a PNG file with the number of bits per sample."""
_SAMPLE_FORMAT = 339
"""Tag of TIFF: 1 for unsigned numbers."""

_MODES = ("trinary", "scale", "raw")
_KEYS = ("image", "resolution", "origin", "mode", "negate", "occupied_thresh", "free_thresh")
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?", re.ASCII)
_WHOLE = re.compile(r"[-+]?[0-9]{1,18}", re.ASCII)
_TRUE = frozenset({"y", "yes", "true", "on"})
_FALSE = frozenset({"n", "no", "false", "off"})
_UNTURNED = 1e-6
"""Largest yaw that counts as 0 [rad]: a millimetre in a kilometre."""
_UNKNOWN_GREY = 205
"""Map savers write unknown cells with this grey."""


@dataclass(frozen=True)
class Description:
    """The content of a map's YAML file."""

    image: str
    """Path of the image, relative to the YAML file."""
    resolution: float
    """[m]"""
    x: float
    """Lower left corner [m]."""
    y: float
    mode: str
    negate: bool
    occupied_thresh: float
    free_thresh: float


def parse_description(content: bytes, name: str) -> Description:
    """Parse a map's YAML file.

    Args:
        content: the file.
        name: the file's name for messages.

    Raises:
        InputError: the file is not valid; the message names file and key.
    """
    data = _mapping(content, name)
    for key in data.keys() - set(_KEYS):
        for meant in difflib.get_close_matches(str(key), _KEYS, n=1, cutoff=0.8):
            raise InputError(f"the map {name}: there is no key `{key}`", hint=f"write `{meant}`")
    keys = _Keys(name, data)
    x, y = keys.origin()
    mode = keys.text("mode", "trinary").lower()
    if mode not in _MODES:
        raise keys.error("mode", f"one of {', '.join(_MODES)}")
    occupied, free = keys.share("occupied_thresh", "0.65"), keys.share("free_thresh", "0.196")
    if free > occupied:
        raise keys.error("free_thresh", f"at most `occupied_thresh`, {occupied:g}")
    resolution = keys.number("resolution")
    if resolution is None or resolution <= 0:
        raise keys.error("resolution", "a number above 0")
    image = keys.text("image", "")
    if not image or "\0" in image:
        raise InputError(
            f"the map {name}: `image` must name an image file.",
            hint="set `image` to the image file of the map",
        )
    return Description(image, resolution, x, y, mode, keys.negate(), occupied, free)


def _mapping(content: bytes, name: str) -> dict[Any, Any]:
    """The keys and values as text, because YAML 1.1 and 1.2 read numbers differently."""
    try:
        node = next(compose_yaml(content), None)
        data = node and yaml.BaseLoader("").construct_document(node)  # only text
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        raise InputError(f"the map {name} cannot be read: not valid YAML: {error}") from error
    if node is None or not isinstance(data, dict):
        raise InputError(
            f"{name} is not a valid map", hint="write a mapping with `image` and `resolution`"
        )
    for key, times in Counter(key.value for key, _ in node.value).items():
        if times > 1:
            raise InputError(
                f"the map {name}: `{key}` occurs several times", hint="remove all but one"
            )
    return data


@dataclass(frozen=True)
class _Keys:
    """The values of a map's YAML file by key."""

    name: str
    data: dict[Any, Any]

    def error(self, key: str, wanted: str, more: str = "") -> InputError:
        """The error for a value."""
        given = self.data.get(key)
        shown = "missing" if given is None else _plain(given)[:60]
        return InputError(f"the map {self.name}: `{key}` must be {wanted}, not {shown}{more}.")

    def text(self, key: str, default: str) -> str:
        value = self.data.get(key, default)
        if isinstance(value, str):
            return value
        raise self.error(key, "text")

    def number(self, key: str, default: str = "") -> float | None:
        """A finite number; None if it is missing or not one."""
        return _finite(self.data.get(key, default))

    def share(self, key: str, default: str) -> float:
        found = self.number(key, default)
        if found is None or not 0 <= found <= 1:
            raise self.error(key, "a number from 0 to 1")
        return found

    def negate(self) -> bool:
        text = self.text("negate", "0").lower()
        if text in _TRUE | _FALSE:
            return text in _TRUE
        if _WHOLE.fullmatch(text):
            return int(text) != 0
        raise self.error("negate", "0, 1, true or false")

    def origin(self) -> tuple[float, float]:
        given = self.data.get("origin", ["0", "0", "0"])
        items = given if isinstance(given, list) else []
        for item in items:
            if _finite(item) is None:
                raise self.error("origin", "`[x, y, 0.0]`", f"; {_plain(item)} is not a number")
        match [_finite(item) for item in items]:
            case [float() as x, float() as y, float() as yaw]:
                if abs(yaw) <= _UNTURNED:
                    return x, y
                more = "; a rotated map is not supported: set the yaw to 0, or rotate the image"
                raise self.error("origin", "`[x, y, 0.0]`", more)
        raise self.error("origin", "`[x, y, 0.0]`")


def _plain(value: Any) -> str:
    """A value as YAML shows it."""
    if isinstance(value, list):
        return f"[{', '.join(map(_plain, value))}]"
    return str(value) or "empty"


def _finite(value: Any) -> float | None:
    if not isinstance(value, str) or not _NUMBER.fullmatch(value):
        return None
    number = float(value)
    return number if math.isfinite(number) else None


def read_pixels(path: Path, name: str) -> bytes:
    """Read a map's image file.

    Raises:
        InputError: the image is missing, or too large.
    """
    try:
        return read_file(path, most=_LARGEST_IMAGE)
    except FileNotFoundError:
        raise InputError(
            f"the map {name}: its image {path} does not exist.",
            hint="correct `image`, which is relative to the YAML file",
        ) from None
    except (OSError, ValueError) as error:
        why = cause(error) if isinstance(error, OSError) else error
        raise InputError(f"the map {name}: its image {path} cannot be read: {why}") from error


def read_description(path: Path) -> Description:
    """Read a map's YAML file.

    Raises:
        InputError: the file is missing or not valid.
    """
    try:
        content = read_file(path, most=_LARGEST_DESCRIPTION)
    except FileNotFoundError:
        raise InputError(f"there is no map {path}.", hint="correct the path of the map") from None
    except OSError as error:
        raise InputError(f"the map {path} cannot be read: {cause(error)}") from error
    return parse_description(content, str(path))


def cells_of(description: Description, pixels: bytes, name: str, most: int = MOST_CELLS) -> Grid:
    """The cells of a map, as Nav2's map_server publishes them.

    Args:
        description: the content of the YAML file.
        pixels: the image file.
        name: the map's name for messages.
        most: largest number of cells.

    Raises:
        InputError: the image is not in a supported format, damaged, or too large.
    """
    try:
        grey, opaque = _grey(pixels, most)
    except InputError as error:
        message = f"the map {name}: its image {description.image} {error.message}"
        raise InputError(message, hint=error.hint) from None
    except Exception as error:  # Pillow documents none, and damaged files raise many kinds
        raise InputError(
            f"the map {name}: its image {description.image} cannot be read: {error}"
        ) from error
    cells = _table(description)[grey]
    if description.mode != "raw":
        cells[~opaque] = -1
    return cells


def _table(description: Description) -> Grid:
    """The cell of each grey."""
    greys = np.arange(256)
    if description.mode == "raw":
        return np.where(greys <= 100, greys, -1).astype(np.int8)
    occupancy = (greys if description.negate else 255 - greys) / 255
    free, occupied = description.free_thresh, description.occupied_thresh
    if description.mode == "scale" and free < occupied:
        cells = np.rint((occupancy - free) / (occupied - free) * 100)
    else:
        cells = np.full(256, -1.0)
    cells[occupancy >= occupied] = 100
    cells[occupancy <= free] = 0
    if description.mode == "trinary" and cells[_UNKNOWN_GREY] == 0:
        cells[_UNKNOWN_GREY] = -1  # Nav2 saves maps whose `free_thresh` would make it free
    return cells.astype(np.int8)


def _grey(pixels: bytes, most: int) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.bool_]]:
    """Grey from 0 to 255, and which pixels are opaque.

    Raises:
        InputError: the rest of a sentence about the image.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            image = Image.open(io.BytesIO(pixels), formats=_FORMATS)
        except Image.DecompressionBombError:
            raise _too_large(most) from None
        except UnidentifiedImageError:
            formats = "PGM, PPM, PBM, PNG, BMP, JPEG, TIFF"
            raise InputError(
                f"cannot be read: it is not one of {formats}.",
                hint="save it in one of these formats",
            ) from None
    with image:
        if image.width * image.height > most:
            raise _too_large(most)
        if _has_second_page(image):
            raise InputError("has several pages; one is supported.", hint="save it with one page")
        wide = image.mode in _SIXTEEN_BITS and not (image.mode == "I" and image.format == "TIFF")
        if not wide and image.mode not in _EIGHT_BITS:
            raise InputError(
                f"has pixels of the kind {image.mode}, which is not supported.",
                hint="save it in grayscale",
            )
        if isinstance(image, TiffImageFile):
            _check_tags(image, 16 if wide else 8)
        if wide:
            return _wide_grey(image)
        if image.format == "PNG" and image.mode == "L" and "transparency" in image.info:
            most_grey = (1 << pixels[_PNG_BITS]) - 1
            image.info["transparency"] = (
                image.info["transparency"] % (most_grey + 1) * 255 // most_grey
            )
        if image.mode in {"1", "L", "LA"}:
            grey = image.convert("LA")
            return np.asarray(grey.getchannel("L")), np.asarray(grey.getchannel("A")) == _OPAQUE
        color = image.convert("RGBA")
        luma = color.convert("RGB").convert("L", matrix=_LUMA)
        return np.asarray(luma), np.asarray(color.getchannel("A")) == _OPAQUE


def _has_second_page(image: Image.Image) -> bool:
    """Whether a page follows; to count them takes time with the square of their number."""
    try:
        image.seek(1)
    except EOFError:
        return False
    return True


def _check_tags(image: TiffImageFile, most_bits: int) -> None:
    """Refuse a TIFF image that Pillow and Nav2 would read in different ways.

    Raises:
        InputError: the rest of a sentence about the image.
    """
    tags = image.tag_v2
    turned, bits = tags.get(Base.Orientation, 1), tags.get(Base.BitsPerSample, (1,))
    if turned != 1:
        raise InputError(
            f"has the TIFF orientation {turned}", hint="save it upright, with orientation 1"
        )
    if not set(bits) <= {1, most_bits} or set(tags.get(_SAMPLE_FORMAT, (1,))) != {1}:
        raise InputError(
            f"has samples of {bits[0]} bits that are not supported",
            hint="save it with 8 bits, unsigned",
        )


def _wide_grey(image: Image.Image) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.bool_]]:
    values = np.asarray(image).astype(np.uint32)
    if isinstance(image, TiffImageFile) and image.tag_v2.get(Base.PhotometricInterpretation) == 0:
        values = 65535 - values  # white is 0, which Pillow does not apply to 16 bits
    grey = ((values * 255 + 32767) // 65535).astype(np.uint8)
    return grey, values != image.info.get("transparency", -1)


def _too_large(most: int) -> InputError:
    return InputError(
        f"has more than {most:,} cells, the most of a map.", hint="use a coarser resolution"
    )
