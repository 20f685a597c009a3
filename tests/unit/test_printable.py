"""What others wrote does nothing to the terminal that it is shown on."""

import json
import logging

import pytest

from robovast.base.printable import PrintableFormatter, one_line, printable, printable_json


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain text, 名, ü, 🙂, a\u00a0b", "plain text, 名, ü, 🙂, a\u00a0b"),
        ("\x1b[2J\x9b31m\x07\r", "\\x1b[2J\\x9b31m\\x07\\r"),
        ("a\tb\nc", "a\tb\nc"),
        ("\u202edessap", "\\u202edessap"),
        ("a\u200fb\u061c\u200e\u200b", "a\\u200fb\\u061c\\u200e\\u200b"),
        ("caf\udce9", "caf\\udce9"),
    ],
)
def test_controls_are_shown_and_not_obeyed(text: str, shown: str) -> None:
    assert printable(text) == shown
    assert one_line(text) == shown.replace("\n", "⏎")
    record = logging.LogRecord("", 0, "", 0, text, (), None)
    assert PrintableFormatter().format(record) == shown


def test_json_stays_the_same_data() -> None:
    data = {"a\x9b": "名 \x1b[2J\n\u202e\ud800"}
    text = printable_json(json.dumps(data, indent=1, ensure_ascii=False))
    assert json.loads(text) == data
    assert "名" in text
    assert printable(text) == text
