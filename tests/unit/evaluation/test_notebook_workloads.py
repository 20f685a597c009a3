"""The notebooks of a campaign are found by scope; none of another folder."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.campaigns.notebooks import add_notebooks, notebook_of
from support.campaigns.searches import write_search
from support.campaigns.stored import NAME, write, write_campaign

from robovast.base.errors import InputError
from robovast.evaluation.notebooks.data_dir import read_notebook, replace_line
from robovast.evaluation.notebooks.workloads import (
    Target,
    find_notebook,
    find_notebooks,
    target_of,
)


@pytest.mark.parametrize(
    "line",
    [
        "DATA_DIR = ''",
        "DATA_DIR='/path/to/results/hall/0/'",
        'DATA_DIR: str = "/x"  # develop here',
        "DATA_DIR = os.environ['X'] == 'DATA_DIR = '",
    ],
)
def test_the_whole_line_is_replaced(line: str) -> None:
    source = f"import os\n{line}\nprint(DATA_DIR)\n"
    assert replace_line(source, "DATA_DIR", "/a 'b'\\c") == (
        "import os\nDATA_DIR = \"/a 'b'\\\\c\"\nprint(DATA_DIR)\n",
        1,
    )


@pytest.mark.parametrize(
    "line", ["DATA_DIR == ''", "# DATA_DIR = ''", "MY_DATA_DIR = ''", "print(DATA_DIR)"]
)
def test_what_only_looks_like_it_stays(line: str) -> None:
    assert replace_line(line, "DATA_DIR", "/x") == (line, 0)


def test_it_keeps_its_place_in_a_block() -> None:
    source = "if True:\n    DATA_DIR = ''\n    x = 1"
    assert replace_line(source, "DATA_DIR", "/x")[0] == "if True:\n    DATA_DIR = '/x'\n    x = 1"


def test_what_cannot_be_executed_says_why() -> None:
    with pytest.raises(InputError, match="no line `DATA_DIR = ''`"):
        read_notebook(notebook_of("print(1)").encode(), Path("/x"))
    for content in (b"no json", b"[]", b"\xff", b'{"nbformat": 4}'):
        with pytest.raises(InputError, match="not a Jupyter notebook"):
            read_notebook(content, Path("/x"))


def test_notebooks_are_found_by_scope_under_either_spelling(tmp_path: Path) -> None:
    root = write_campaign(tmp_path, runs=1, outputs=False)
    write(
        root / "_config" / "hall.vast",
        "evaluation: {visualization: [Drive: {run: a.ipynb, campaign: b.ipynb}]}\n"
        "analysis: {visualization: [Old: {run: c.ipynb, config: d.ipynb}, [], 7, Odd: {run: 7}]}\n",
    )
    found = [
        [(one.workload, one.path) for one in find_notebooks(target_of(root / place), None)]
        for place in ("", "hall-1", "hall-1/0")
    ]
    assert found == [
        [("Drive", "b.ipynb")],
        [("Old", "d.ipynb")],
        [("Drive", "a.ipynb"), ("Old", "c.ipynb")],
    ]


def test_another_file_can_stand_in_place_of_the_campaigns_own(tmp_path: Path) -> None:
    root = write_campaign(tmp_path / "results", runs=1, outputs=False)
    write(tmp_path / "a.ipynb", notebook_of("DATA_DIR = ''"))
    write(tmp_path / "my.vast", "evaluation: {visualization: [Mine: {campaign: a.ipynb}]}\n")
    found = find_notebook(target_of(root), None, tmp_path / "my.vast")
    assert (found.workload, found.file()) == ("Mine", tmp_path / "a.ipynb")


@pytest.mark.parametrize("path", ["../outside.ipynb", "/etc/passwd", "link.ipynb"])
def test_no_notebook_outside_of_the_campaign_is_taken(tmp_path: Path, path: str) -> None:
    root = write_campaign(tmp_path, runs=1, outputs=False)
    write(root / "outside.ipynb", notebook_of("DATA_DIR = ''"))
    (root / "_config" / "link.ipynb").symlink_to("../outside.ipynb")
    write(
        root / "_config" / "hall.vast", f"evaluation: {{visualization: [A: {{campaign: {path}}}]}}"
    )
    with pytest.raises(InputError, match="outside"):
        find_notebook(target_of(root), None, None).file()


@pytest.mark.parametrize(
    "names",
    [("..",), (NAME, ".."), (NAME, "hall-1", ".."), (NAME, "none"), ("elsewhere",), (NAME, "link")],
)
def test_no_other_folder_is_a_target(tmp_path: Path, names: tuple[str, ...]) -> None:
    root = write_campaign(tmp_path / "results", runs=1, outputs=False)
    (root.parent / "elsewhere").mkdir()
    (root / "link").symlink_to(tmp_path)
    with pytest.raises(InputError):
        _ = Target(root.parent, names).folder


def test_which_workload_is_asked_for_when_there_are_several(tmp_path: Path) -> None:
    root = write_campaign(tmp_path, runs=1, outputs=False)
    with pytest.raises(InputError, match="names no notebook for a campaign"):
        find_notebook(target_of(root), None, None)
    add_notebooks(root, {name: {"campaign": ("DATA_DIR = ''",)} for name in ("A", "B")})
    assert find_notebook(target_of(root), "B", None).workload == "B"
    with pytest.raises(InputError, match="`A`, `B`"):
        find_notebook(target_of(root), None, None)
    with pytest.raises(InputError, match="is the folder of no campaign"):
        target_of(tmp_path)


def test_a_notebook_for_a_batch_gets_its_number(tmp_path: Path) -> None:
    root = write_search(tmp_path / "results", batches=2, runs=False, strategy="random")
    (document,) = (root / "_config").glob("*.vast")
    text = "evaluation: {visualization: [Round: {batch: a.ipynb, campaign: b.ipynb}]}\n"
    document.write_text(text)
    write(root / "_config" / "a.ipynb", notebook_of("DATA_DIR = ''\nBATCH = None", "BATCH == 7"))
    target = target_of(root, 1)
    found = find_notebook(target, None, None)
    assert (found.scope, found.path, target.folder) == ("batch", "a.ipynb", root)
    made = read_notebook(found.file().read_bytes(), target.folder, 1)
    assert made.cells[0].source == f"DATA_DIR = {str(root)!r}\nBATCH = 1"
    assert made.cells[1].source == "BATCH == 7"
    assert find_notebook(target_of(root), None, None).path == "b.ipynb"


def test_what_is_no_batch_or_needs_none_is_refused(tmp_path: Path) -> None:
    root = write_search(tmp_path / "results", batches=2, runs=False, strategy="random")
    with pytest.raises(InputError, match="no batch 2 with scores; its batches are 0 to 1"):
        _ = target_of(root, 2).folder
    other = write_campaign(tmp_path / "other", runs=1, outputs=False)
    with pytest.raises(InputError, match="no batch 0 with scores; it has none yet"):
        _ = target_of(other, 0).folder
    with pytest.raises(InputError, match="belongs to a campaign"):
        _ = target_of(other / "hall-1", 0).folder
