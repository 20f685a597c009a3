"""Changes to the bytes of a file, such as damage, other tools and attackers make them."""

from __future__ import annotations

import re
from random import Random

_TOKENS = [
    *(
        b"",
        b"\0",
        b"\xff\xfe",
        b"\xef\xbb\xbf",
        b"\xc3",
        b"\r\n",
        b"\r",
        b"\t",
        b" ",
        b"\xe2\x80\xa8",
    ),
    *(
        b"-1",
        b"0",
        b"4294967296",
        b"18446744073709551616",
        b"1e999",
        b"-0.0",
        b"nan",
        b".inf",
        b"1_1",
    ),
    *(b"null", b"~", b"true", b"no", b"12:30", b"2026-11-25", b'"', b"'", b"{", b"[", b"]", b"}"),
    *(b"../../x", b"/etc/passwd", b"..", b"a" * 5000, b"[" * 3000, b"{a: " * 2000, b"- " * 2000),
    *(
        b"!!python/object:os.system x",
        b"!!binary =",
        b"!!timestamp x",
        b"!!set {a, b}",
        b"&a [*a]",
        b"*a",
    ),
    *(
        b"<<: *b",
        b"? [a]\n: b",
        b"<!DOCTYPE x>",
        b"<![CDATA[",
        b"]]>",
        b"&x;",
        b"&#0;",
        b"%s",
        b"\\ud800",
    ),
    *(
        b"\xf0\x9f\x98\x80",
        b"9" * 5000,
        b"\x80",
        b"\x00\x00\x00\x00",
        b"\xff\xff\xff\xff\xff\xff\xff\x7f",
    ),
]
_NUMBER = re.compile(rb"\d+(?:\.\d+)?")
_WORD = re.compile(rb"[A-Za-z_][\w./-]*")


def mutated(content: bytes, other: bytes, chance: Random) -> bytes:
    """Return a content with one to four changes; some splice another one in."""
    for _ in range(chance.choice((1, 1, 1, 2, 3, 4))):
        content = chance.choice(_CHANGES)(content, other, chance)
    return content[:1_000_000]


def _span(content: bytes, chance: Random) -> tuple[int, int]:
    begin = chance.randint(0, len(content))
    return begin, min(len(content), begin + chance.choice((1, 1, 2, 4, 8, 64, 1024)))


def _flip(content: bytes, _: bytes, chance: Random) -> bytes:
    if not content:
        return b"x"
    place = chance.randrange(len(content))
    return content[:place] + bytes([chance.randrange(256)]) + content[place + 1 :]


def _cut(content: bytes, _: bytes, chance: Random) -> bytes:
    begin, end = _span(content, chance)
    return content[:begin] + content[end:]


def _end(content: bytes, _: bytes, chance: Random) -> bytes:
    return content[: chance.randint(0, len(content))]


def _insert(content: bytes, _: bytes, chance: Random) -> bytes:
    place = chance.randint(0, len(content))
    return content[:place] + chance.choice(_TOKENS) + content[place:]


def _repeat(content: bytes, _: bytes, chance: Random) -> bytes:
    begin, end = _span(content, chance)
    return content[:end] + content[begin:end] * chance.choice((1, 2, 50)) + content[end:]


def _splice(content: bytes, other: bytes, chance: Random) -> bytes:
    begin, end = _span(other, chance)
    place = chance.randint(0, len(content))
    return content[:place] + other[begin:end] + content[place:]


def _replace(content: bytes, _: bytes, chance: Random) -> bytes:
    found = list(chance.choice((_NUMBER, _WORD)).finditer(content[:100_000]))
    if not found:
        return _insert(content, b"", chance)
    match = chance.choice(found)
    return content[: match.start()] + chance.choice(_TOKENS) + content[match.end() :]


def _lines(content: bytes, _: bytes, chance: Random) -> bytes:
    lines = content.splitlines(keepends=True)
    one, two = (chance.randrange(len(lines)) for _ in range(2)) if lines else (0, 0)
    if lines:
        lines[one], lines[two] = lines[two], lines[one]
    return b"".join(lines)


_CHANGES = (
    _flip,
    _cut,
    _end,
    _insert,
    _insert,
    _repeat,
    _splice,
    _replace,
    _replace,
    _replace,
    _lines,
)
