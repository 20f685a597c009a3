"""Damaged and hostile archives: one clear message, at once, and nothing is imported."""

import io
import tarfile
import time
import zipfile
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robovast.base.errors import InputError
from robovast.campaign.importing import import_archive

SOON = 5.0
"""Time that reading a small archive may take on a busy machine [s]."""


def header(name: bytes, size: bytes, kind: bytes) -> bytes:
    block = bytearray(512)
    block[: len(name)] = name
    block[100:107], block[108:115], block[116:123] = b"0000644", b"0000000", b"0000000"
    block[124 : 124 + len(size)], block[136:147] = size, b"00000000000"
    block[156:157], block[257:265], block[148:156] = kind, b"ustar\x0000", b" " * 8
    block[148:156] = b"%06o\0 " % sum(block)
    return bytes(block)


def base_256(number: int) -> bytes:
    return b"\xff" + (number & ((1 << 88) - 1)).to_bytes(11, "big")


def pax(body: bytes) -> bytes:
    padded = body + bytes(-len(body) % 512)
    entry = header(b"c/_config/a.vast", b"00000000000\0", b"0")
    return header(b"p", b"%011o\0" % len(body), b"x") + padded + entry


VALID = header(b"c/_config/b.vast", b"00000000000\0", b"0")
KINDS = [b"0", b"1", b"2", b"5", b"7", b"g", b"x", b"X", b"L", b"K", b"S", b"V", b"Z", b"\0"]


def refused(folder: Path, content: bytes, name: str = "k.tar") -> None:
    (folder / name).write_bytes(content)
    began = time.monotonic()
    with pytest.raises(InputError):
        import_archive(folder / name, folder / "out")
    assert time.monotonic() - began < SOON
    assert not list((folder / "out").glob("*"))


@pytest.mark.parametrize("size", [-1, -512, -1024, -(2**40), -(2**87)])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("first", [b"", VALID])
def test_a_negative_size_is_refused(tmp_path: Path, size: int, kind: bytes, first: bytes) -> None:
    entry = header(b"c/_config/a.vast", base_256(size), kind)
    refused(tmp_path, first + entry + bytes(1024))


@pytest.mark.parametrize(
    "body",
    [
        b"1" * 16_000 + b"\n",
        b"1" * 500_000 + b"\n",
        b"1" * 16_384,
        b"17 size=-1048576\n",
        b"11 size=x\n",
        b"30 GNU.sparse.size=9999999999\n",
        b"99 path=x\n",
        b"0 path=x\n",
    ],
    ids=lambda body: repr(body[:20]),
)
def test_a_hostile_pax_header_is_refused(tmp_path: Path, body: bytes) -> None:
    (tmp_path / "k.tar").write_bytes(VALID + pax(body) + bytes(1024))
    began = time.monotonic()
    try:
        import_archive(tmp_path / "k.tar", tmp_path / "out")
    except InputError:
        assert not list((tmp_path / "out").glob("*"))
    assert time.monotonic() - began < SOON


def tar_bytes() -> bytes:
    file = io.BytesIO()
    with tarfile.open(fileobj=file, mode="w", format=tarfile.PAX_FORMAT) as tar:
        for name in ("c/_config/a.vast", f"c/{'é' * 60}/{'b' * 120}"):
            entry = tarfile.TarInfo(name)
            entry.size, entry.mtime = 3, 1.5
            tar.addfile(entry, io.BytesIO(b"abc"))
    return file.getvalue()


def zip_bytes() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as zipped:
        zipped.writestr("c/_config/a.vast", "abc" * 100)
        zipped.writestr("c/_execution/execution.yaml", "{}")
    return file.getvalue()


@settings(max_examples=200, deadline=None)
@given(
    st.sampled_from([tar_bytes(), zip_bytes()]),
    st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=8),
    st.floats(0.3, 1),
)
def test_damage_raises_no_other_error(
    tmp_path_factory: pytest.TempPathFactory,
    content: bytes,
    changes: list[tuple[float, int]],
    kept: float,
) -> None:
    folder = tmp_path_factory.mktemp("a")
    damaged = bytearray(content)
    for place, value in changes:
        damaged[int(place * (len(damaged) - 1))] = value
    (folder / "k").write_bytes(damaged[: int(kept * len(damaged))])
    with suppress(InputError):
        import_archive(folder / "k", folder / "out")
