"""Parses untrusted XML.

| supported | how it is recognized |
| --- | --- |
| XML 1.0 without a document type | expat; text in CDATA, comments and instructions is content |
| UTF-8, UTF-16, UTF-32 | byte order mark, zeros of the first character, or declaration |
| US-ASCII, ISO-8859-1 to -16, windows-1250 to -1258 | declaration |

A declared document type is refused, because it can declare entities that expand without bound.
Bytes that are invalid in the encoding are read as U+FFFD.
"""

from __future__ import annotations

import codecs
import re
import xml.etree.ElementTree as ET  # entities cannot be declared without a document type
from typing import Any

_MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",  # before UTF-16, whose mark it begins with
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
    b"<\0\0\0": "utf-32-le",
    b"\0\0\0<": "utf-32-be",
    b"<\0": "utf-16-le",
    b"\0<": "utf-16-be",
}
_DECLARED = re.compile(rb"""<\?xml\s[^>]*?\bencoding\s*=\s*["']([^"'>]{1,40})["']""")
_ONE_BYTE = re.compile(r"ascii|iso8859-\d+|cp125\d")
_WIDE = re.compile(r"utf-(16|32)(-[lb]e)?")
_TYPE = re.compile(r"\ufeff?(?:\s++|<!--.*?-->|<\?.*?\?>)*+<!DOCTYPE", re.DOTALL)
"""A declared document type: only white space, comments and instructions can precede it."""


class UnsupportedXmlError(ValueError):
    """The XML declares a document type, or an encoding that is not supported."""


def parse_xml(content: bytes, target: Any = None) -> Any:
    """Parse XML.

    Args:
        content: the document.
        target: receives the elements, as described for `xml.etree.ElementTree.XMLParser`.

    Returns:
        What `target.close` returns; without a target, the outermost element.

    Raises:
        UnsupportedXmlError: the document declares a document type or an unsupported encoding.
        ValueError: the document is not valid.
    """
    text = content.decode(_encoding(content), "replace")
    if _TYPE.match(text):
        raise UnsupportedXmlError("it declares a document type, which may declare entities")
    parser = ET.XMLParser(target=target)  # noqa: S314  # no entities, see above
    try:
        parser.feed(text)  # text, so that the parser reads what was examined
        return parser.close()
    except ET.ParseError as error:
        raise ValueError(f"XML: {error}") from None


def _encoding(content: bytes) -> str:
    for mark, encoding in _MARKS.items():
        if content.startswith(mark):
            return encoding
    found = _DECLARED.match(content)
    declared = found[1].decode("ascii", "replace") if found else "utf-8"
    try:
        name = codecs.lookup(declared).name
    except (LookupError, ValueError):
        name = ""
    if name == "utf-8" or _WIDE.fullmatch(name):  # legible without zeros, so it is not wide
        return "utf-8"
    if _ONE_BYTE.fullmatch(name):
        return name
    raise UnsupportedXmlError(f"its encoding `{declared}` is not supported")
