"""Notebooks are executed on request, in a kernel of their own, and their output has no rights."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from support.campaigns.notebooks import add_notebooks, notebook_of
from support.campaigns.searches import write_search
from support.campaigns.stored import NAME, write, write_campaign
from support.patience import eventually
from support.servers.page import VAST, ShownPage, shown

EVIL = "<script>parent.document.title = 'stolen'</script>"
SCOPES = {
    "campaign": f"campaign={NAME}",
    "config": f"campaign={NAME}&variant=hall-1",
    "run": f"campaign={NAME}&variant=hall-1&run=0",
}
DATA = "DATA_DIR = ''"
SHOW = "from pathlib import Path\nprint('data', *sorted(p.name for p in Path(DATA_DIR).iterdir()))"


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("notebooks")
    root = write_campaign(folder / "results")
    begin = f"{DATA}\nimport os, pathlib, time\npathlib.Path({str(folder / 'begun')!r}).touch()"
    write(root / "_config" / "analysis" / "helper.py", "ANSWER = 'of the helper'\n")
    add_notebooks(
        root,
        {
            "Files": dict.fromkeys(SCOPES, (DATA, SHOW)),
            "Failing": {"run": (DATA, "import helper\nprint(helper.ANSWER)", "1 / 0", "print(7)")},
            "Endless": {
                "run": (f"{begin}\nprint('pid', os.getpid(), flush=True)\nwhile True: pass",)
            },
            "Held": {
                "run": (
                    f"{begin}\nwhile not os.path.exists({str(folder / 'go')!r}): time.sleep(0.05)",
                )
            },
            "Dying": {"run": (f"{DATA}\nimport os\nos._exit(3)",)},
            "Evil": {"run": (DATA, f"from IPython.display import HTML\nHTML({EVIL!r})")},
            "Nothing": {"run": ("print(1)",)},
            "Needing": {"run": (DATA, "import late")},
        },
    )
    return root


@pytest.fixture(scope="module")
def page(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ShownPage]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        with shown(root.parent) as page:
            yield page


@pytest.fixture
def begun(root: Path) -> Path:
    """A file that is made when one of the notebooks begins that do not end soon."""
    file = root.parents[1] / "begun"
    file.unlink(missing_ok=True)
    return file


def execute(page: ShownPage, workload: str, scope: str = "run", more: str = ""):
    answer = page.post(f"api/notebook?{SCOPES[scope]}&workload={workload}{more}")
    assert answer.status == 200, answer.body
    return answer.data


def output(page: ShownPage, result) -> str:
    return page.get(f"notebooks/{result['key']}").body.decode()


@pytest.mark.parametrize(
    ("scope", "names"),
    [
        ("campaign", "hall-1 hall-2"),
        ("config", "data 0 1 _config"),
        ("run", "job poses.csv run.json"),
    ],
)
def test_a_notebook_gets_the_folder_of_its_scope(page: ShownPage, scope: str, names: str) -> None:
    result = execute(page, "Files", scope)
    assert result["fault"] == ""
    assert names in output(page, result)


def test_a_notebook_is_executed_once_until_something_changes(page: ShownPage, root: Path) -> None:
    first = execute(page, "Files")
    assert execute(page, "Files") == first
    assert execute(page, "Files", more="&again=1")["ended"] > first["ended"]
    write(root / "hall-1" / "0" / "new.csv", "a\n1\n")
    assert "new.csv" in output(page, execute(page, "Files"))


def test_listing_executes_nothing_and_shows_what_is_known(page: ShownPage) -> None:
    scope = SCOPES["run"].replace("run=0", "run=1")
    before = {one["workload"]: one for one in page.get(f"api/notebooks?{scope}").data}
    assert list(before) == [
        "Files", "Failing", "Endless", "Held", "Dying", "Evil", "Nothing", "Needing",
    ]  # fmt: skip
    assert all(one["result"] is None and not one["running"] for one in before.values())
    assert page.get(f"api/notebook?{scope}&workload=Files").status == 405
    done = page.post(f"api/notebook?{scope}&workload=Files").data
    assert page.get(f"api/notebooks?{scope}").data[0]["result"] == done


def test_a_notebook_for_a_batch_of_a_search_gets_its_number(tmp_path: Path) -> None:
    root = write_search(tmp_path / "results", batches=3, runs=False, strategy="random")
    (document,) = (root / "_config").glob("*.vast")
    visualization = "evaluation: {visualization: [Round: {batch: round.ipynb}]}\n"
    document.write_text(document.read_text() + visualization)
    cells = (f"{DATA}\nBATCH = None", "print('batch', BATCH + 40)", SHOW)
    write(root / "_config" / "round.ipynb", notebook_of(*cells))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        with shown(root.parent) as page:
            asked = f"campaign={root.name}&batch=2"
            (listed,) = page.get(f"api/notebooks?{asked}").data
            assert listed["command"].endswith(" Round --batch 2")
            result = page.post(f"api/notebook?{asked}&workload=Round").data
            assert result["fault"] == ""
            assert "batch 42" in output(page, result)
            assert "_execution" in output(page, result)
            for batch in ("3", "-1", "x"):
                path = f"api/notebooks?campaign={root.name}&batch={batch}"
                assert page.get(path).status == 404


def test_an_error_is_shown_with_its_cell(page: ShownPage) -> None:
    result = execute(page, "Failing")
    assert result["fault"] == "Cell 3 failed: ZeroDivisionError: division by zero"
    shown = output(page, result)
    assert "of the helper" in shown  # cells before it, with modules beside the notebook
    assert "output_error" in shown
    assert "ZeroDivisionError" in shown


def test_a_notebook_that_failed_is_executed_again(page: ShownPage, root: Path) -> None:
    """It may have lacked what the key does not know of, as a package, or a module beside it."""
    assert "ModuleNotFoundError" in execute(page, "Needing")["fault"]
    write(root / "_config" / "analysis" / "late.py", "")
    assert execute(page, "Needing")["fault"] == ""


def test_a_kernel_that_ends_is_an_error_in_words(page: ShownPage) -> None:
    assert "kernel died in cell 1" in execute(page, "Dying")["fault"]


def test_a_notebook_without_the_line_says_so(page: ShownPage) -> None:
    result = execute(page, "Nothing")
    assert "no line `DATA_DIR = ''`" in result["fault"]
    assert not result["has_output"]


def test_a_notebook_that_takes_long_keeps_no_other_back(
    page: ShownPage, root: Path, begun: Path
) -> None:
    with ThreadPoolExecutor() as pool:
        held = pool.submit(execute, page, "Held")
        try:
            eventually(begun.exists)
            assert execute(page, "Files", "config", "&again=1")["fault"] == ""
            assert not held.done()
        finally:
            (root.parents[1] / "go").touch()
        assert held.result()["fault"] == ""


def test_a_notebook_that_takes_too_long_is_stopped(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with shown(root.parent, "--notebook-timeout", "5") as page:
        result = execute(page, "Endless")
        assert result["fault"] == "Cell 1 was stopped: the notebook may take 5 s."
        kernel = output(page, result).split("pid ")[-1].split()[0]
        gone = "the kernel was left behind"
        eventually(lambda: not Path("/proc", kernel).exists(), told=gone)


def test_output_has_no_rights(page: ShownPage) -> None:
    result = execute(page, "Evil")
    answer = page.get(f"notebooks/{result['key']}")
    assert EVIL.encode() in answer.body  # a browser that obeys the policy does nothing with it
    policy = answer.headers["content-security-policy"].split("; ")
    assert {"default-src 'none'", "sandbox", "img-src data:", "frame-ancestors 'self'"} <= {*policy}
    assert not any("script" in one or "allow" in one for one in policy)


@pytest.mark.parametrize("headers", [{"Origin": None}, {"Origin": "http://evil.example"}])
def test_only_the_page_itself_executes(page: ShownPage, headers) -> None:
    answer = page.post(f"api/notebook?{SCOPES['run']}&workload=Files", **headers)
    assert answer.status in {403, 405}


@pytest.mark.parametrize(
    "path",
    [
        "notebooks/..%2f..%2fetc",
        f"notebooks/{'0' * 64}",
        "api/notebooks",
        "api/notebooks?campaign=..",
        f"api/notebooks?campaign={NAME}&variant=..",
    ],
)
def test_there_is_nothing_elsewhere(page: ShownPage, path: str) -> None:
    assert page.get(path).status in {403, 404}


def test_the_server_ends_while_a_notebook_is_executed(
    root: Path, tmp_path: Path, begun: Path
) -> None:
    with pytest.MonkeyPatch.context() as patch, ThreadPoolExecutor() as pool:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path))
        with shown(root.parent) as page:
            path = f"api/notebook?{SCOPES['run']}&workload=Endless"
            waiting = pool.submit(page.post, path)
            eventually(begun.exists)
        assert waiting.result().data["error"]


def test_a_notebook_opens_in_jupyter_with_its_folder_set(root: Path, tmp_path: Path) -> None:
    jupyter = tmp_path / "bin" / "jupyter-lab"
    write(jupyter, '#!/bin/sh\necho "opened $1 $PYTHONPATH"\n')
    jupyter.chmod(0o755)
    run = root / "hall-1" / "0"
    command = [VAST, "evaluation", "notebook", run, "Files"]
    environment = {"PATH": f"{jupyter.parent}:/usr/bin:/bin", "HOME": str(tmp_path)}

    def call() -> str:
        options = {"cwd": tmp_path, "env": environment, "text": True, "check": True}
        return subprocess.run(command, capture_output=True, **options).stdout

    name = f"Files_run-{NAME}-hall-1-0.ipynb"
    assert f"opened {name} {root}/_config/analysis" in call()
    copy = tmp_path / name
    assert f"DATA_DIR = '{run}'" in copy.read_text()
    copy.write_text("mine")
    assert "is not modified" in call()
    assert copy.read_text() == "mine"
