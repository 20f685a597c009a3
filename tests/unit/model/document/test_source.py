"""YAML is read with the place of every value, and what would mislead or explode is refused."""

from __future__ import annotations

import time
import tracemalloc
from pathlib import Path

import pytest

from robovast.base.errors import DocumentError, InputError
from robovast.model.document.source import Source, render_path

FILE = Path("a.vast")


def problem_of(text: str) -> str:
    with pytest.raises(DocumentError) as error:
        _ = Source(FILE, text).data
    return str(error.value)


def test_data_and_places() -> None:
    source = Source(FILE, "a: 1\nb:\n  - c: true\n    d: [x, 2.5, null]\n")
    assert source.data == {"a": 1, "b": [{"c": True, "d": ["x", 2.5, None]}]}
    assert str(source.place(("b", 0, "d", 1))) == "a.vast:4:12"
    assert str(source.place(("b", 0, "d"), key=True)) == "a.vast:4:5"


def test_the_place_of_what_is_missing_is_that_of_its_nearest_parent() -> None:
    source = Source(FILE, "a:\n  b: 1\n")
    assert str(source.place(("a", "none", 3))) == "a.vast:2:3"


def test_paths_read_as_people_write_them() -> None:
    assert render_path(("configuration", 2, "variations", 0, "Name")) == (
        "configuration[2].variations[0].Name"
    )


def test_merge_keys_and_aliases_work() -> None:
    source = Source(FILE, "base: &b {x: 1}\nother:\n  <<: *b\n  y: 2\nsame: *b\n")
    assert source.data == {"base": {"x": 1}, "other": {"x": 1, "y": 2}, "same": {"x": 1}}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a:\n- [1, 2", "the `[` of line 2 is not closed: here must be `,` or `]`"),
        ("a: {b: 1\nc: 2\n", "the `{` of line 1 is not closed: here must be `,` or `}`"),
        ("a: 'b\nc: 1\n", "the quotes that open in line 1 are not closed"),
        ("a: b: c\n", "a.vast:1:5: not valid YAML: there is a second `:` in one value"),
        ("a: b\n  c: d\n", "a.vast:2:4: not valid YAML: there is a second `:` in one value"),
        ("a: b\n  c: d\n", "and indent keys like the keys around them"),
        ("a:\n\tb: 1\n", "a.vast:2:1: not valid YAML: a tab; YAML is indented with spaces alone"),
        ("a: @b\n", "a.vast:1:4: not valid YAML: a value cannot begin with `@`"),
        ("a: *b\n", "`*name` has no matching anchor `&name` above it"),
        ("a:\n  b: 1\n c: 2\n", "a.vast:3:2: not valid YAML: this does not continue the mapping"),
        ("a:\n  - b\n  c: 2\n", "not valid YAML: this does not continue the list that begins in"),
        ("c: 1\na\nb: 1\n", "a.vast:3:1: not valid YAML: there is no `:` after the key in line 2"),
        ('a: "\\q"\n', "double quotes do not know this escape"),
        ("<<: 3\n", "`<<` can only merge mappings"),
        ('a: "\a"\n', "the character 0x07 is not allowed in YAML (in line 1)"),
        ("a: 2026-99-99\n", "a.vast:1:4: `2026-99-99` is an impossible date"),
        ("2026-99-99: a\n", "a.vast:1:1: `2026-99-99` is an impossible date"),
        ("a: !!timestamp x\n", "a.vast:1:4: `x` is an impossible date"),
        (f"a: 0x{'f' * 5000}\n", "a.vast:1:4: `0xffff"),
        (f"a: 1{':59' * 4000}\n", "is an impossible number; if it is text, put it into quotes"),
        ("a: 1\na: 2\n", "a.vast:2:1: the key `a` occurs twice in one mapping, first in line 1"),
        ("a: &x [*x]\n", "an alias (`*name`) refers to a value that contains the alias"),
        ("a: !!python/object:os.system {}\n", "a.vast:1:4: the tag `tag:yaml.org,2002:python/"),
        ("a: !own 1\n", "a.vast:1:4: the tag `!own` has no meaning here"),
        ("? [1, 2]\n: 3\n", "a key must be a plain value"),
        ("[" * 5000 + "]" * 5000, "nested too deeply"),
    ],
)
def test_what_cannot_be_right_is_refused_with_its_place(text: str, message: str) -> None:
    assert message in problem_of(text)


def test_aliases_that_explode_are_refused_quickly_and_in_little_memory() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 12)]
    tracemalloc.start()
    begin = time.process_time()
    message = problem_of("\n".join(lines))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "aliases" in message
    assert time.process_time() - begin < 10
    assert peak < 200 * 2**20


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "there is no such file"), (b"\xff\xfe\x00", "not a text file in UTF-8")],
)
def test_files_that_cannot_be_read(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "b.vast"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        Source.read(path)
