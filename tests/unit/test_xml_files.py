"""XML is parsed as expat parses it, except that a document type is refused."""

from __future__ import annotations

import time
from contextlib import suppress
from xml.etree import ElementTree as ET
from xml.parsers import expat

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robovast.base.xml_files import parse_xml
from robovast.storage.shares.webdav import _files

DOCTYPE = "<!DOCTYPE a [<!ENTITY b 'x'>]>"
INNER = st.text(st.sampled_from("x <>&[]!-?é\n\"'"), max_size=12) | st.sampled_from(
    [DOCTYPE, "<!ENTITY b 'x'>", "-->", "?>", "<!--", "]]>"]
)
HEADS = st.lists(
    st.sampled_from(
        [" ", "\n", "\t", DOCTYPE, "<!doctype a>", "<?xml-model a?>", "<?p " + DOCTYPE + "?>"]
    )
    | INNER.map(lambda text: f"<!--{text}-->")
    | INNER.map(lambda text: f"<?p {text}?>"),
    max_size=4,
).map("".join)


def declares_a_type(content: bytes) -> bool:
    """Whether expat reports a document type."""
    found: list[str] = []
    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = lambda name, *_: found.append(name)
    with suppress(expat.ExpatError):
        parser.Parse(content, True)
    return bool(found)


def parsed(content: bytes) -> ET.Element | None:
    try:
        return parse_xml(content)
    except ValueError:
        return None


@given(HEADS, INNER, st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"]))
@example("", DOCTYPE, "utf-8")
@example(DOCTYPE, "", "utf-16")
@example(f"<!--{DOCTYPE}-->", "", "utf-16")
def test_a_type_is_refused_and_nothing_that_only_looks_like_one(
    head: str, inner: str, encoding: str
) -> None:
    declared = (
        "" if encoding in ("utf-8", "utf-8-sig") else '<?xml version="1.0" encoding="UTF-16"?>'
    )
    content = f"{declared}{head}<a><![CDATA[{inner}]]><!--c--></a>".encode(encoding)
    found = parsed(content)
    if declares_a_type(content):
        assert found is None
        return
    try:
        right = ET.fromstring(content)  # noqa: S314  # our own
    except ET.ParseError:
        assert found is None
    else:
        assert found is not None
        assert ET.tostring(found) == ET.tostring(right)


@pytest.mark.parametrize(
    ("declared", "encoding"),
    [
        ("UTF-8", "utf-8"),
        ("utf8", "utf-8"),
        ("ISO-8859-1", "latin-1"),
        ("latin1", "latin-1"),
        ("ISO-8859-15", "iso8859-15"),
        ("windows-1252", "cp1252"),
        ("UTF-16", "utf-16"),
        ("utf-16", "utf-8"),  # text that was converted after it was declared
        ("UTF-32", "utf-32"),
        ("", "utf-16"),
        ("", "utf-8-sig"),
    ],
)
def test_supported_encodings(declared: str, encoding: str) -> None:
    head = f'<?xml version="1.0" encoding="{declared}"?>' if declared else ""
    assert parse_xml(f'{head}<a n="größer"/>'.encode(encoding)).get("n") == "größer"


@pytest.mark.parametrize(
    "declared", ["utf-7", "hex", "zip", "rot13", "idna", "nonsense", "cp037", "é"]
)
def test_other_encodings_are_refused(declared: str) -> None:
    content = f'<?xml version="1.0" encoding="{declared}"?><a/>'.encode()
    with pytest.raises(ValueError, match=r"encoding `.*` is not supported"):
        parse_xml(content)


@given(st.binary(max_size=200) | st.binary(max_size=40).map(lambda b: b"<?xml" + b))
def test_any_bytes_raise_no_other_error(content: bytes) -> None:
    parsed(content)


def test_bombs_are_refused_before_they_expand() -> None:
    levels = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10}">' for n in range(1, 30))
    bomb = f'<!DOCTYPE a [<!ENTITY e0 "lol">{levels}]><a>&e29;</a>'
    started = time.monotonic()
    for content in (bomb.encode(), ("<!--" + "x" * 10**6 + "-->" + bomb).encode("utf-16")):
        with pytest.raises(ValueError, match="declares a document type"):
            parse_xml(content)
    for content in (b"<!--" * 10**6, b"<?p" * 10**6, b" " * 10**7, b"<a " + b"x" * 10**7):
        with pytest.raises(ValueError, match="XML: "):
            parse_xml(content)
    assert time.monotonic() - started < 20, "seconds"


def test_a_server_may_not_declare_a_type_in_any_encoding() -> None:
    listing = (
        '<d:multistatus xmlns:d="DAV:"><d:response><d:href>/x/a.tar</d:href><d:propstat><d:prop>'
        "<d:resourcetype/><d:getcontentlength>7</d:getcontentlength></d:prop></d:propstat>"
        "</d:response></d:multistatus>"
    )
    for encoding in ("utf-8", "utf-16"):
        assert dict(_files(listing.encode(encoding))) == {"a.tar": 7}
        with pytest.raises(ValueError, match="declares a document type"):
            list(_files((DOCTYPE + listing).encode(encoding)))
