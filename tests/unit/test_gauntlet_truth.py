"""What a gauntlet compares with: it must see every fault, and none where there is none."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from support.gauntlet.truth import Course, Kind, look_at_files, read_trace

from robovast.campaign.verdict import Verdict
from robovast.model.document import load_document

RUNS = {Kind.PASS: "one-1/0", Kind.FAIL: "one-1/1", Kind.CRASH: "one-2/0", Kind.ODD: "one-2/1"}


@pytest.fixture
def course(tmp_path: Path) -> Course:
    kinds = [Kind.PASS] * 17
    for kind, run in RUNS.items():
        x, number = (int(part) for part in run.removeprefix("one-").split("/"))
        kinds[(5 * x + number) % 17] = kind
    made = Course("salt-1", f"cat >>{tmp_path}/trace", runs=2, pause=0, kinds=kinds)
    made.write(tmp_path / "course")
    return made


def execute(tmp_path: Path, run: str) -> int:
    """Execute a run's script below another process, as the scenario does."""
    folder = tmp_path / "out" / run
    folder.mkdir(parents=True, exist_ok=True)
    x = run.removeprefix("one-").partition("/")[0]
    script = tmp_path / "course" / "step.sh"
    words = ["bash", "-c", 'bash "$@"; exit $?', "parent", script, x, folder]
    return subprocess.run(words, check=False, capture_output=True).returncode


def written(tmp_path: Path, run: str) -> dict[str, bytes]:
    folder = tmp_path / "out" / run
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.parametrize("kind", RUNS)
def test_every_kind_of_run_does_and_writes_what_its_course_says(
    course: Course, tmp_path: Path, kind: Kind
) -> None:
    run = RUNS[kind]
    assert course.kind(run) is kind
    code = execute(tmp_path, run)
    assert code == {Kind.FAIL: 1, Kind.CRASH: -9}.get(kind, 0)
    seen = look_at_files(course, run, written(tmp_path, run))
    assert seen.wrong == ()
    (execution,) = seen.executions
    traces = [read_trace(line) for line in (tmp_path / "trace").read_text().splitlines()]
    assert [(t.run, t.execution, t.event) for t in traces if t] == [
        (run, execution, "begin"),
        (run, execution, kind.value),
    ]


def test_files_of_two_executions_or_of_another_run_are_seen(course: Course, tmp_path: Path) -> None:
    execute(tmp_path, "one-1/0")
    first = written(tmp_path, "one-1/0")
    execute(tmp_path, "one-1/0")
    second = written(tmp_path, "one-1/0")
    mixed = look_at_files(course, "one-1/0", second | {"first.txt": first["first.txt"]})
    assert mixed.wrong == ()
    assert len(mixed.executions) == 2
    other = look_at_files(course, "one-3/0", {"first.txt": first["first.txt"]})
    assert other.foreign == ("'first.txt' has another content",)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"first.txt": None}, "b'first.txt' is there 0 times"),
        ({"first.txt": b""}, "b'first.txt' is there 0 times"),
        ({"new.txt": b"made up"}, "'new.txt' has another content"),
    ],
)
def test_what_is_missing_cut_or_made_up_is_seen(
    course: Course, tmp_path: Path, change: dict[str, bytes | None], said: str
) -> None:
    execute(tmp_path, "one-1/0")
    files: dict[str, bytes | None] = {**written(tmp_path, "one-1/0"), **change}
    seen = look_at_files(course, "one-1/0", {k: v for k, v in files.items() if v is not None})
    assert said in seen.wrong


def test_a_file_that_was_cut_or_copied_is_seen(course: Course, tmp_path: Path) -> None:
    execute(tmp_path, "one-1/0")
    files = written(tmp_path, "one-1/0")
    cut = look_at_files(course, "one-1/0", files | {"last.txt": files["last.txt"][:-1]})
    assert cut.missing == ("b'last.txt' is there 0 times",)
    assert not cut.foreign
    twice = look_at_files(course, "one-1/0", files | {"copy.txt": files["last.txt"]})
    assert "b'last.txt' is there 2 times" in twice.wrong


def test_names_that_had_to_be_changed_are_known_by_their_content(
    course: Course, tmp_path: Path
) -> None:
    execute(tmp_path, "one-2/1")
    files = written(tmp_path, "one-2/1")
    odd = next(name for name in files if "utf-8" in name)
    renamed = {**files, "some-other-name": files[odd]}
    del renamed[odd]
    assert look_at_files(course, "one-2/1", renamed).wrong == ()


def test_a_course_is_a_document_whose_counts_are_known(course: Course, tmp_path: Path) -> None:
    document = load_document(tmp_path / "course" / "course.vast")
    assert document.vast.execution.runs_per_job == course.runs_per_job
    truth = course.truth()
    assert len(truth) == 12
    assert truth["one-1/1"] is Verdict.FAILED
    assert course.counts()[Verdict.ERRORED] == 1
    assert set(truth) < set(course.with_runs(3).truth())
