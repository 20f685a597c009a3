"""Maps are read as Nav2's map_io reads them; everything else is refused with file and key."""

from __future__ import annotations

import io
import re
import struct
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, PngImagePlugin

from robovast.base.errors import InputError
from robovast.navigation.map_files import MOST_CELLS, cells_of, parse_description
from robovast.navigation.occupancy import decode_map, read_map

CASES = Path(__file__).parents[2] / "data/cases/maps"
ROWS = re.findall(
    r"^\| ([a-z].*?) \| (\d+) \| (\d+) \| (\d+) \|", (CASES / "README.md").read_text(), re.M
)
COUNTS = [(name, *map(int, counts)) for names, *counts in ROWS for name in names.split(", ")]


@pytest.mark.parametrize(("name", "occupied", "free", "unknown"), COUNTS)
def test_a_map_has_the_cells_of_nav2(name: str, occupied: int, free: int, unknown: int) -> None:
    found = read_map(CASES / f"{name}.yaml")
    counts = found.occupied.sum(), found.free.sum(), (~found.free & ~found.occupied).sum()
    assert counts == (occupied, free, unknown)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("modebad", "`mode` must be one of trinary, scale, raw, not ternary"),
        ("thrtext", "`occupied_thresh` must be a number from 0 to 1, not high"),
        ("thrlist", "`free_thresh` must be a number from 0 to 1, not [0.2]"),
        (
            "originnannan",
            "`origin` must be `[x, y, 0.0]`, not [-10.0, -10.0, -nan]; -nan is not a n",
        ),
    ],
)
def test_a_wrong_map_is_refused_with_file_and_key(name: str, said: str) -> None:
    with pytest.raises(InputError, match=re.escape(f"{name}.yaml: {said}")):
        read_map(CASES / f"{name}.yaml")


def text_of(**keys: object) -> bytes:
    all_keys = {"image": "m.png", "resolution": 0.1, "origin": "[0, 0, 0]", **keys}
    return "".join(f"{key}: {value}\n" for key, value in all_keys.items()).encode()


def nav2_cell(grey: int, alpha: int, mode: str, negate: bool, occupied: float, free: float) -> int:
    """The value that map_io gives to a pixel, cell by cell, and the rule for the grey 205."""
    if mode == "raw":
        return grey if grey <= 100 else -1
    if alpha < 255:
        return -1
    shade = grey / 255 if negate else (255 - grey) / 255
    if shade <= free:
        return -1 if mode == "trinary" and grey == 205 else 0
    if shade >= occupied:
        return 100
    return round((shade - free) / (occupied - free) * 100) if mode == "scale" else -1


def png(pixels: np.ndarray, **options: object) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG", **options)
    return file.getvalue()


EDGES = st.sampled_from([0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 0.196, 0.25, 0.65]) | st.floats(0, 1)


@given(
    greys=st.lists(st.integers(0, 255), min_size=1, max_size=20),
    alpha=st.sampled_from([0, 1, 127, 128, 254, 255]),
    mode=st.sampled_from(["trinary", "scale", "raw"]),
    negate=st.sampled_from(["0", "1", "2", "true", "'true'", "False", "off", "ON", "yes", "n"]),
    limits=st.tuples(EDGES, EDGES).map(sorted),
    wide=st.booleans(),
)
def test_any_map_has_the_cells_of_nav2(greys, alpha, mode, negate, limits, wide) -> None:
    free, occupied = limits
    keys = {
        "mode": mode.title(),
        "negate": negate,
        "occupied_thresh": occupied,
        "free_thresh": free,
    }
    description = parse_description(text_of(**keys), "m.yaml")
    if wide:
        alpha, pixels = 255, png(np.array([greys], np.uint16) * 257)
    else:
        pixels = png(np.array([[[grey, alpha] for grey in greys]], np.uint8))
    on = negate.strip("'").lower() in {"1", "2", "true", "on", "yes"}
    right = [nav2_cell(grey, alpha, mode, on, occupied, free) for grey in greys]
    assert cells_of(description, pixels, "m.yaml").tolist() == [right]


@given(st.integers(1, 65535), st.data())
def test_a_pgm_is_scaled_by_its_largest_value(largest: int, data: st.DataObject) -> None:
    values = data.draw(st.lists(st.integers(0, largest), min_size=1, max_size=8))
    width = "u1" if largest < 256 else ">u2"
    head = f"{len(values)} 1\n# a comment\n{largest}\n"
    binary = b"P5\n" + head.encode() + np.array(values, width).tobytes()
    ascii_ = f"P2\n{head}{' '.join(map(str, values))}\n".encode()
    raw = parse_description(text_of(mode="raw"), "m.yaml")
    for pixels in (binary, ascii_):
        found = cells_of(raw, pixels, "m.yaml")[0].astype(float)
        exact = np.array(values) * 255 / largest
        assert np.all((np.abs(found - exact) <= 0.51) | ((found == -1) & (exact >= 100.49)))


def test_color_becomes_grey_by_its_luma_and_palettes_count() -> None:
    raw = parse_description(text_of(mode="raw"), "m.yaml")
    colors = np.array([[[255, 0, 0], [0, 100, 0], [0, 0, 255], [7, 7, 7]]], np.uint8)
    assert cells_of(raw, png(colors), "m").tolist() == [[54, 72, 18, 7]]
    palette = Image.fromarray(colors).quantize(4)
    file = io.BytesIO()
    palette.save(file, "PNG", transparency=palette.getpixel((3, 0)))
    trinary = parse_description(text_of(), "m.yaml")
    assert cells_of(trinary, file.getvalue(), "m").tolist() == [[100, 100, 100, -1]]


def test_a_wide_grey_can_be_transparent() -> None:
    content = bytearray(png(np.array([[0, 257 * 9]], np.uint16)))
    at = content.index(b"IDAT") - 4
    chunk = io.BytesIO()
    PngImagePlugin.putchunk(chunk, b"tRNS", (257 * 9).to_bytes(2, "big"))
    content[at:at] = chunk.getvalue()
    description = parse_description(text_of(), "m.yaml")
    assert cells_of(description, bytes(content), "m").tolist() == [[100, -1]]


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"mode": "[raw]"}, "`mode` must be text, not [raw]"),
        ({"mode": ""}, "`mode` must be one of trinary, scale, raw, not empty"),
        ({"negate": "0.0"}, "`negate` must be 0, 1, true or false, not 0.0"),
        ({"negate": "maybe"}, "`negate` must be 0, 1, true or false, not maybe"),
        ({"negate": "{a: 1}"}, "`negate` must be text"),
        ({"resolution": "five"}, "`resolution` must be a number above 0, not five"),
        ({"resolution": "0x1"}, "`resolution` must be a number above 0, not 0x1"),
        ({"resolution": "1_0"}, "`resolution` must be a number above 0, not 1_0"),
        ({"resolution": "1:30"}, "`resolution` must be a number above 0, not 1:30"),
        ({"resolution": ".inf"}, "`resolution` must be a number above 0, not .inf"),
        ({"resolution": "1e999"}, "`resolution` must be a number above 0, not 1e999"),
        ({"resolution": "0"}, "`resolution` must be a number above 0, not 0"),
        ({"resolution": "~"}, "`resolution` must be a number above 0, not ~"),
        ({"origin": "[0, 0]"}, "`origin` must be `[x, y, 0.0]`, not [0, 0]"),
        ({"origin": "[0, 0, 0, 0]"}, "`origin` must be `[x, y, 0.0]`, not [0, 0, 0, 0]"),
        ({"origin": "[.nan, 0, 0]"}, ".nan is not a number"),
        ({"origin": "[a, 0, 0]"}, "a is not a number"),
        ({"origin": "[[1], 0, 0]"}, "[1] is not a number"),
        ({"origin": "0"}, "`origin` must be `[x, y, 0.0]`, not 0"),
        ({"origin": "{x: 0}"}, "`origin` must be"),
        ({"origin": "[0, 0, 0.1]"}, "is not supported: set the yaw to 0, or rotate the image"),
        ({"occupied_thresh": "65"}, "`occupied_thresh` must be a number from 0 to 1, not 65"),
        ({"free_thresh": "-0.1"}, "`free_thresh` must be a number from 0 to 1, not -0.1"),
        ({"free_thresh": ".nan"}, "`free_thresh` must be a number from 0 to 1, not .nan"),
        ({"free_thresh": "0.7"}, "`free_thresh` must be at most `occupied_thresh`, 0.65, not 0.7"),
        ({"image": "[a]"}, "`image` must be text, not [a]"),
        ({"image": '"a\\0b"'}, "`image` must name an image file"),
        ({"ocupied_thresh": "0.5"}, "there is no key `ocupied_thresh`. Write `occupied_thresh`"),
        ({"Negate": "1"}, "there is no key `Negate`. Write `negate`"),
    ],
)
def test_other_values_are_refused(keys: dict[str, str], said: str) -> None:
    with pytest.raises(
        InputError, match=re.escape(f"the map m.yaml: {said}") if "`" in said else re.escape(said)
    ):
        parse_description(text_of(**keys), "m.yaml")


@pytest.mark.parametrize("text", ["5e-2", "'5e-2'", "+.05", "0.05", "5.E-2", "05e-2"])
def test_a_number_may_have_an_exponent_or_quotes(text: str) -> None:
    assert parse_description(text_of(resolution=text, name="hall"), "m").resolution == 0.05


@given(st.text(max_size=60) | st.binary(max_size=60))
def test_any_text_is_a_map_or_refused(content: str | bytes) -> None:
    content = content.encode("utf-8", "replace") if isinstance(content, str) else content
    for text in (content, text_of(negate="") + content, text_of(origin="") + content):
        assert "m.yaml" in refusal(lambda text=text: parse_description(text, "m.yaml"))


def refusal(act: Callable[[], object]) -> str:
    """The message of an action, which may raise no other error."""
    try:
        act()
    except InputError as error:
        return str(error)
    return "m.yaml is accepted"


def saved(mode: str, kind: str, **options: object) -> bytes:
    file = io.BytesIO()
    Image.new(mode, (3, 2)).save(file, kind, **options)
    return file.getvalue()


def frames(kind: str) -> bytes:
    file = io.BytesIO()
    first, second = Image.new("L", (3, 2)), Image.new("L", (3, 2), 9)
    first.save(file, kind, save_all=True, append_images=[second])
    return file.getvalue()


@pytest.mark.parametrize(
    ("pixels", "said"),
    [
        (saved("RGB", "WEBP"), "it is not one of PGM, PPM, PBM, PNG, BMP, JPEG, TIFF"),
        (saved("P", "GIF"), "it is not one of PGM, PPM, PBM, PNG, BMP, JPEG, TIFF"),
        (saved("F", "TIFF"), "has pixels of the kind F, which is not supported"),
        (saved("I", "TIFF"), "has pixels of the kind I, which is not supported"),
        (saved("CMYK", "JPEG"), "has pixels of the kind CMYK, which is not supported"),
        (frames("TIFF"), "has several pages"),
        (frames("PNG"), "has several pages"),
        (b"P5 16000 12000 255\n", f"has more than {MOST_CELLS:,} cells"),
        (b"P5 9000 9000 255\n", f"has more than {MOST_CELLS:,} cells"),
        (b"P5 3 2 70000\n", "cannot be read"),
        (b"P5 3 2 0\n", "cannot be read"),
        (b"P5 3 2 255\n\0", "cannot be read"),
        (b"", "cannot be read"),
    ],
)
def test_other_images_are_refused(pixels: bytes, said: str) -> None:
    with pytest.raises(InputError, match=f"the map m.yaml: its image m.png .*{re.escape(said)}"):
        decode_map(text_of(), pixels, "m.yaml", MOST_CELLS)


@given(st.sampled_from(["PNG", "PPM", "BMP", "JPEG", "TIFF"]), st.data())
def test_damaged_images_raise_no_other_error(kind: str, data: st.DataObject) -> None:
    content = bytearray(saved("L", kind))
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    with_end = bytes(content[: data.draw(st.integers(0, len(content)))])
    for pixels in (bytes(content), with_end):
        said = refusal(lambda pixels=pixels: decode_map(text_of(), pixels, "m.yaml", 1_000_000))
        assert said.startswith(("the map m.yaml: its image m.png ", "m.yaml is accepted"))


def test_an_image_must_be_a_file(tmp_path: Path) -> None:
    (tmp_path / "m.png").mkdir()
    (tmp_path / "m.yaml").write_bytes(text_of())
    with pytest.raises(InputError, match=r"its image .*m.png cannot be read"):
        read_map(tmp_path / "m.yaml")
    (tmp_path / "m.yaml").write_bytes(b"#" * (2 << 20))
    with pytest.raises(InputError, match=r"m.yaml cannot be read: .*larger"):
        read_map(tmp_path / "m.yaml")


def packed(greys: list[int], bits: int, order: str) -> bytes:
    """Samples of one row, padded with zeros to whole bytes."""
    if bits == 16:
        return np.array(greys, f"{order}u2").tobytes()
    text = "".join(format(grey, f"0{bits}b") for grey in greys)
    return bytes(int(text[at : at + 8].ljust(8, "0"), 2) for at in range(0, len(text), 8))


def tiff(greys: list[int], bits: int, order: str, **tags: int) -> bytes:
    """A grey TIFF image of one row."""
    data = packed(greys, bits, order)
    data += b"\0" * (len(data) % 2)
    numbers = {256: len(greys), 257: 1, 258: bits, 259: 1, 273: 8, 277: 1, 278: 1, 279: len(data)}
    numbers |= {int(tag[1:]): value for tag, value in tags.items()}
    head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(f"{order}I", 8 + len(data))
    entries = [struct.pack(f"{order}HHIHH", tag, 3, 1, n, 0) for tag, n in sorted(numbers.items())]
    return head + data + struct.pack(f"{order}H", len(entries)) + b"".join(entries) + b"\0" * 4


@given(
    bits=st.sampled_from([1, 2, 4, 8, 12, 16]),
    order=st.sampled_from("<>"),
    white_is_zero=st.booleans(),
    orientation=st.sampled_from([None, *range(9)]),
    sample_format=st.sampled_from([None, 1, 2]),
    data=st.data(),
)
def test_a_tiff_has_the_greys_of_its_samples_or_is_refused(
    bits, order, white_is_zero, orientation, sample_format, data
) -> None:
    most = (1 << bits) - 1
    greys = data.draw(st.lists(st.integers(0, most), min_size=2, max_size=9))
    tags = {"t262": int(not white_is_zero)}
    tags |= {} if orientation is None else {"t274": orientation}
    tags |= {} if sample_format is None else {"t339": sample_format}
    pixels = tiff(greys, bits, order, **tags)
    supported = bits in (1, 8, 16) and orientation in (None, 1) and sample_format != 2
    description = parse_description(text_of(mode="raw"), "m.yaml")
    said = refusal(lambda: cells_of(description, pixels, "m.yaml"))
    if said != "m.yaml is accepted":
        assert "m.png" in said
        assert not supported or (bits == 16 and white_is_zero and order == ">")  # not in Pillow
        return
    assert supported
    shades = [most - grey if white_is_zero else grey for grey in greys]
    right = [round(shade * 255 / most) for shade in shades]
    right = [grey if grey <= 100 else -1 for grey in right]
    assert cells_of(description, pixels, "m.yaml").tolist() == [right]


@given(bits=st.sampled_from([1, 2, 4, 8, 16]), data=st.data())
def test_a_transparent_grey_of_any_png_is_unknown(bits: int, data: st.DataObject) -> None:
    most = (1 << bits) - 1
    greys = data.draw(st.lists(st.integers(0, most), min_size=1, max_size=9))
    clear = data.draw(st.sampled_from(greys))
    file = io.BytesIO(b"\x89PNG\r\n\x1a\n")
    file.seek(0, io.SEEK_END)
    head = struct.pack(">IIBBBBB", len(greys), 1, bits, 0, 0, 0, 0)
    PngImagePlugin.putchunk(file, b"IHDR", head)
    PngImagePlugin.putchunk(file, b"tRNS", clear.to_bytes(2, "big"))
    PngImagePlugin.putchunk(file, b"IDAT", zlib.compress(b"\0" + packed(greys, bits, ">")))
    PngImagePlugin.putchunk(file, b"IEND", b"")
    description = parse_description(
        text_of(mode="scale", occupied_thresh=0.5, free_thresh=0.5), "m.yaml"
    )
    found = cells_of(description, file.getvalue(), "m.yaml")[0].tolist()
    assert [cell == -1 for cell in found] == [grey == clear for grey in greys]


@given(st.sampled_from(["image", "resolution", "origin", "negate", "mode", "own"]), st.booleans())
def test_a_key_that_occurs_twice_is_refused(key: str, quoted: bool) -> None:
    content = text_of(negate=0, mode="raw", own=1)
    again = f"'{key}'" if quoted else key
    with pytest.raises(InputError, match=f"the map m.yaml: `{key}` occurs several times"):
        parse_description(content + f"{again}: 1\n".encode(), "m.yaml")


def test_a_file_of_many_pages_is_refused_at_the_second() -> None:
    """Counting them takes time with the square of their number."""
    first = tiff([0, 255], 8, "<")
    (place,) = struct.unpack_from("<I", first, 4)
    (count,) = struct.unpack_from("<H", first, place)
    directory = first[place : place + 2 + 12 * count]
    pages = bytearray(first)
    following = place + len(directory)
    for _ in range(50_000):
        struct.pack_into("<I", pages, following, len(pages))
        following = len(pages) + len(directory)
        pages += directory + b"\0\0\0\0"
    begin = time.process_time()
    with pytest.raises(InputError, match="has several pages"):
        decode_map(b"image: x.tif\nresolution: 1.0\n", bytes(pages), "x", MOST_CELLS)
    assert time.process_time() - begin < 2
