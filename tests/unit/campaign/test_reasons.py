"""The reason of a run names the action that failed and the last error of the run's own output."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from robovast.base.plugins import plugins_of
from robovast.campaign.judge import Ending, judge
from robovast.campaign.reasons import LONGEST, plain
from robovast.campaign.verdict import Verdict, read_test_result

START = 1795389798.45
COMMAND = "Execution of '['python3', '/config/files/navigate.py', '--out', '/out/drive-1/0']' {}"
TREE = """-^- navigate [✕]
    {-} navigate [✕]
        {-} serial [✕]
            --> run_process [✕]"""


def executor(level: str, text: str, second: float = 1.0) -> str:
    colour = ("\x1b[31m", "\x1b[0m") if level == "ERROR" else ("", "")
    return f"[{level}] [{START + second:.6f}] [scenario_execution]: {colour[0]}{text}{colour[1]}"


def error(text: str) -> str:
    """What a process of the scenario writes to stderr."""
    return executor("ERROR", text)


BEGIN = executor("INFO", "Executing scenario 'navigate'", 0.0)
END = error(f"navigate: execution failed. {TREE} -- {COMMAND.format('failed with 1')}")
TRACEBACK = [
    error("Traceback (most recent call last):"),
    error('File "/config/files/navigate.py", line 55, in <module>'),
    error("raise lab.SensorLost('no data')"),
    error("lab.SensorLost: no data"),
]


def reason(
    folder: Path,
    *log: str,
    said: str = COMMAND.format("failed with 1"),
    tree: str = TREE,
    run: str = "",
) -> str:
    """The reason of a run that failed with this log."""
    text = tree + (f" -- {said}" if said else "")
    text = text.replace(">", "&gt;")
    (folder / "test.xml").write_text(
        f'<testsuite tests="1" failures="1" time="2"><testcase><properties><property '
        f'name="start_time" value="{START}"/></properties><failure message="execution failed.">'
        f"{text}</failure></testcase></testsuite>"
    )
    judged = judge(read_test_result(folder), Ending(1), 60, "\n".join(log).encode(), run)
    assert judged.verdict is Verdict.FAILED
    return judged.reason


@pytest.mark.parametrize(
    ("log", "expected"),
    [
        (
            [
                error("[ERROR] [1795389799.37] [simulator]: collision after 9.1 s at 3.66, 1.13"),
                error("[INFO] [1795389799.38] [follower]: a way of 5.3 m"),
            ],
            "collision after 9.1 s at 3.66, 1.13",
        ),
        (TRACEBACK, "lab.SensorLost: no data"),
        ([error("RuntimeError: sensor lost")], "RuntimeError: sensor lost"),
        (
            [
                error("[navigate-1] RuntimeError: sensor lost"),
                error("[ERROR] [navigate-1]: process has died [pid 7, exit code 1, cmd '/x/y']"),
            ],
            "RuntimeError: sensor lost",
        ),
        (
            [error("[ERROR] [navigate-1]: process has died [pid 7, exit code -11]")],
            "process has died [pid 7, exit code -11]",
        ),
        ([error("[navigate-1] [FATAL] [12.5] [amcl]: no map")], "no map"),
        ([error("usage: x"), error("navigate.py: error: no --map")], "no --map"),
        ([error("terminate called after throwing"), error("what():  bad grid")], "bad grid"),
        ([executor("INFO", "2026-03-04 13:24:44 ERROR: low battery")], "low battery"),
        ([error("share below 0.9")], "share below 0.9"),
        ([error("WARNING: slow"), error("share below 0.9")], "share below 0.9"),
        (
            [executor("INFO", "final population 580.6")],
            "python3 navigate.py failed with 1; its output ends: final population 580.6",
        ),
        ([], "python3 navigate.py failed with 1"),
    ],
)
def test_the_last_error_of_the_output_is_the_cause(
    tmp_path: Path, log: list[str], expected: str
) -> None:
    assert reason(tmp_path, BEGIN, *log, END, "[robovast] ended with code 1") == (
        f"run_process: {expected}"
    )


@pytest.mark.parametrize("code", ["1" * 5000, f"-{'9' * 5000}", "\u00b2", "--1", ""])
def test_a_code_that_no_program_ends_with_is_text(tmp_path: Path, code: str) -> None:
    said = COMMAND.format(f"failed with {code}")
    assert "python3 navigate.py" in reason(tmp_path, BEGIN, END, said=said)


def test_harmless_lines_on_stderr_are_no_errors(tmp_path: Path) -> None:
    harmless = error("[INFO] [1795389799.10] [follower]: a way of 5.3 m")
    found = reason(tmp_path, BEGIN, harmless, END)
    assert found.startswith("run_process: python3 navigate.py failed with 1")


def test_what_happens_after_the_result_is_no_cause(tmp_path: Path) -> None:
    after = error("RuntimeError: shutting down")
    assert reason(tmp_path, BEGIN, error("ERROR: no map"), END, after) == "run_process: no map"


def test_a_run_of_a_pack_has_the_errors_of_its_own_part_of_the_log(tmp_path: Path) -> None:
    before = [executor("INFO", "Executing scenario 'navigate'", -9.0), error("ERROR: before")]
    after = [executor("INFO", "Executing scenario 'navigate'", 2.5), error("ERROR: after")]
    log = [*before, BEGIN, error("ERROR: own"), END, *after]
    assert reason(tmp_path, *log) == "run_process: own"


def test_a_process_that_was_killed_is_told_with_its_signal(tmp_path: Path) -> None:
    said = COMMAND.format("failed with -11")
    assert reason(tmp_path, BEGIN, error("ERROR: bad grid"), END, said=said) == (
        "run_process: python3 navigate.py was ended by SIGSEGV; bad grid"
    )


def test_what_an_action_says_itself_comes_before_the_error(tmp_path: Path) -> None:
    said = "goal rejected"
    assert reason(tmp_path, BEGIN, END, said=said) == "run_process: goal rejected"
    log = [BEGIN, error("[ERROR] [1.5] [planner]: no way"), END]
    assert reason(tmp_path, *log, said=said) == "run_process: goal rejected; no way"


def test_an_action_that_says_nothing_is_named(tmp_path: Path) -> None:
    assert reason(tmp_path, BEGIN, END, said="") == "run_process failed"
    no_file = error("[Errno 2] No such file or directory: 'python4'")
    expected = "run_process: [Errno 2] No such file or directory: 'python4'"
    assert reason(tmp_path, BEGIN, no_file, END, said="") == expected


def test_the_timeout_of_the_scenario_is_told_with_the_action_that_it_stopped(
    tmp_path: Path,
) -> None:
    tree = "-^- navigate [✕]\n    {-} navigate [-]\n        --> run_process [-]"
    said = "Executing '['python3', '/config/a.py']'"
    assert reason(tmp_path, BEGIN, END, said=said, tree=tree) == (
        "run_process: stopped by the scenario's timeout"
    )


def test_a_run_of_a_pack_is_not_told_with_the_error_of_the_next_one(tmp_path: Path) -> None:
    """Both begin within a second; the log names them."""
    own, other = error("the first one's"), error("the second one's")
    later = executor("INFO", "Executing scenario 'navigate'", 0.3)
    log = ["[robovast] run a/0", BEGIN, own, END, "[robovast] run a/1", later, other, END]
    assert reason(tmp_path, *log, run="a/0") == "run_process: the first one's"
    assert reason(tmp_path, *log, run="a/1") == "run_process: the second one's"


def test_what_the_next_run_writes_is_not_its_own_where_its_beginning_is_missing(
    tmp_path: Path,
) -> None:
    costmap = [error("costmap 2 timed out")] * 9
    log = [error("grasp lost"), END, "[robovast] run a/1", BEGIN, *costmap]
    assert reason(tmp_path, *log, run="a/0") == "run_process: grasp lost"
    silent = reason(tmp_path, END, *log[2:], run="a/0", said="")
    assert "costmap" not in silent


def test_the_executors_own_beginning_is_no_output_of_a_run(tmp_path: Path) -> None:
    log = ["[robovast] run a/0", BEGIN]
    assert "Executing" not in reason(tmp_path, *log, run="a/0")


def test_messages_that_two_threads_wrote_on_one_line_are_told_apart(tmp_path: Path) -> None:
    line = executor("INFO", "final population 355.8") + error("share below 0.85")
    assert reason(tmp_path, BEGIN, line, END) == "run_process: share below 0.85"
    turned = error("share below 0.85") + executor("INFO", "final population 355.8")
    assert reason(tmp_path, BEGIN, turned, END) == "run_process: share below 0.85"


def test_a_crash_is_told_with_its_last_error(tmp_path: Path) -> None:
    log = "\n".join([BEGIN, *TRACEBACK, "/config/entrypoint.sh: line 200: 9 Killed"])
    crashed = judge(read_test_result(tmp_path), Ending(137), 60, log.encode())
    assert (crashed.verdict, crashed.reason) == (
        Verdict.ERRORED,
        "the run wrote no test.xml; it was ended by SIGKILL (out of memory?); "
        "lab.SensorLost: no data",
    )


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("cannot read /config/maps/depot.yaml", "cannot read depot.yaml"),
        ("no message on /robot/scan", "no message on /robot/scan"),
        ("nothing on /odom after 3 s", "nothing on /odom after 3 s"),
        ("/home/a/x/.running/job-0/config", "config"),
        ("see https://example.org/a/b.html", "see https://example.org/a/b.html"),
        ("a\x1b[31mred\x1b[0m\nline", "ared line"),
        (COMMAND.format("failed with 3"), "python3 navigate.py failed with 3"),
    ],
)
def test_paths_arguments_and_colours_are_left_out(text: str, expected: str) -> None:
    assert plain(text) == expected


def test_a_reason_stays_short_and_is_found_quickly_whatever_the_log(tmp_path: Path) -> None:
    hostile = ["Error:" * 50_000, "/a" * 50_000, "Execution of '[" * 20_000, "x" * 200_000]
    for line in hostile:
        assert len(reason(tmp_path, BEGIN, line, END)) < 3 * LONGEST


@pytest.fixture
def rules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An installed package with two rules, one of them faulty."""
    (tmp_path / "lab_rules.py").write_text(
        "import json\n"
        "def from_json(lines):\n"
        "    found = [json.loads(line) for line in lines if line.startswith('{')]\n"
        "    bad = [item['text'] for item in found if item['severity'] > 2]\n"
        "    return bad[-1] if bad else None\n"
    )
    info = tmp_path / "lab_rules-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: lab-rules\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[robovast.failure_reasons]\njson = lab_rules:from_json\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    plugins_of.cache_clear()
    yield
    plugins_of.cache_clear()
    sys.modules.pop("lab_rules", None)


@pytest.mark.usefixtures("rules")
def test_a_rule_of_another_package_knows_its_own_format(tmp_path: Path) -> None:
    told = '{"severity": 3, "text": "no grip"}'
    assert reason(tmp_path, BEGIN, told, error("ERROR: other"), END) == "run_process: no grip"
    assert reason(tmp_path, BEGIN, error("ERROR: other"), END) == "run_process: other"


@pytest.mark.usefixtures("rules")
def test_a_rule_that_fails_says_so_and_changes_no_verdict(tmp_path: Path) -> None:
    found = reason(tmp_path, BEGIN, "{no json", END)
    assert "the rule `json` of robovast.failure_reasons failed: JSONDecodeError" in found


CRASH = """\
import ctypes, threading, time
threading.Thread(target=time.sleep, args=(9,), daemon=True).start()

def steer():
    ctypes.string_at(0)

steer()
"""


def test_the_crash_of_a_program_in_python_has_its_place(tmp_path: Path) -> None:
    (tmp_path / "pilot.py").write_text(CRASH)
    command = [sys.executable, "-X", "faulthandler", "pilot.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "Segmentation fault" in done.stderr
    modules = "Extension modules: yaml._yaml, numpy.linalg (total: 2)"
    said = [*done.stderr.splitlines(), modules]
    found = reason(
        tmp_path, BEGIN, *map(error, said), END, said=COMMAND.format(f"failed with {-11}")
    )
    place = "Segmentation fault in steer (pilot.py, line 5)"
    assert found == f"run_process: python3 navigate.py was ended by SIGSEGV; {place}"
