"""The helpers that run inside containers, where nothing of RoboVAST is installed."""

from __future__ import annotations

import ast
import csv
import os
import signal
import stat
import subprocess
import sys
import xml.etree.ElementTree as ET
from datetime import datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from support.patience import PATIENCE, eventually

from robovast.execution.contract import (
    COLLECT_SYSINFO,
    MONITOR_RESOURCES,
    RUN_SCENARIOS,
    collect_sysinfo,
    contract_files,
    monitor_resources,
)

FILES = {path.name: path for path in contract_files()}


@pytest.fixture(scope="module")
def driver() -> SimpleNamespace:
    """The module's names; as a program it changes `sys.path`, which is put back."""
    argv, path = sys.argv, sys.path[:]
    sys.argv = [RUN_SCENARIOS, sys.executable]
    try:
        names: dict[str, object] = {"__name__": "run_scenarios"}
        exec(compile(FILES[RUN_SCENARIOS].read_text(), RUN_SCENARIOS, "exec"), names)  # noqa: S102
        return SimpleNamespace(**names)
    finally:
        sys.argv, sys.path[:] = argv, path


def result(**changes: object) -> SimpleNamespace:
    fields = {
        "name": "try_it-0",
        "result": True,
        "failure_message": "",
        "failure_output": "",
        "processing_time": timedelta(seconds=1.5),
        "start_time": datetime.fromtimestamp(1000.25),
    }
    return SimpleNamespace(**{**fields, **changes})


UNENDABLE = """
import os, subprocess, sys
sys.argv[1:] = [sys.executable]
names = {"__name__": "run_scenarios"}
exec(open(sys.argv[0]).read(), names)
with subprocess.Popen(["sleep", "600"]) as other:
    try:
        assert names["has_children"]()
        names["ENDING"] = tuple((number, 0.1) for number, _ in names["ENDING"])
        os.seteuid(1000), os.setresuid(1000, 1000, 0)
        print(names["end_leftovers"]() == [other.pid])
    finally:
        os.seteuid(0)
        other.kill()
"""


@pytest.mark.skipif(os.getuid() != 0, reason="only root may start processes of another user")
def test_what_cannot_be_ended_is_named() -> None:
    code = UNENDABLE.replace("sys.argv[0]", repr(str(FILES[RUN_SCENARIOS])))
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.stdout == "True\n", done.stderr


def test_every_file_of_the_contract_is_there() -> None:
    assert all(path.is_file() for path in FILES.values())
    for path in FILES.values():
        assert path.suffix != ".sh" or path.stat().st_mode & stat.S_IXUSR


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".py")])
def test_a_helper_is_written_in_the_python_of_old_images(name: str) -> None:
    ast.parse(FILES[name].read_text(), feature_version=(3, 8))


@pytest.mark.parametrize("value", ["it's", "a: b # c", "", "- x", "null", "1e3", "ä\tö"])
def test_sysinfo_writes_text_as_yaml_reads_it(value: str) -> None:
    lines = collect_sysinfo.to_yaml({"outer": {"inner": value}, "number": 1.5})
    assert yaml.safe_load("\n".join(lines)) == {"outer": {"inner": value}, "number": 1.5}


@pytest.mark.parametrize(("text", "value"), [("4", 4), ("2.5", 2.5), ("8Gi", "8Gi"), ("", "")])
def test_sysinfo_keeps_a_number_a_number(text: str, value: object) -> None:
    assert collect_sysinfo.number(text) == value


def test_sysinfo_says_what_the_machine_has_when_nobody_tells(tmp_path: Path) -> None:
    out = tmp_path / "sysinfo.yaml"
    command = [sys.executable, "-I", "-S", FILES[COLLECT_SYSINFO], out]
    subprocess.run(command, env={}, check=True)
    info = yaml.safe_load(out.read_text())
    assert 0 < info["available_cpus"] <= (os.cpu_count() or 0)
    assert info["available_mem"] > 2**20
    assert info["platform"]["release"] == os.uname().release


def test_the_name_of_a_process_may_hold_any_character() -> None:
    line = "7 (a) b (c) S 3 7 7 0 -1 4194560 99 0 0 0 150 50 0 0 20 0 1 0 500 1000 25 18446744073"
    process = monitor_resources.ProcessStat(line)
    assert (process.pid, process.name) == (7, "a) b (c")
    assert process.cpu == 200 / monitor_resources.TICKS
    assert process.rss == 25 * monitor_resources.PAGE


def test_cpu_is_that_since_the_last_sample_or_since_the_process_began() -> None:
    process = SimpleNamespace(pid=7, name='a,"b', cpu=3.0, began=90.0, rss=4096)
    first = monitor_resources.row(process, 5.0, 100.0, None)  # type: ignore[arg-type]
    later = monitor_resources.row(process, 5.0, 100.0, (2.5, 99.0))  # type: ignore[arg-type]
    assert next(csv.reader([first])) == ["5.000", "7", 'a,"b', "30.0", "4096"]
    assert next(csv.reader([later]))[3] == "50.0"


def test_an_orphan_stays_in_the_family(tmp_path: Path) -> None:
    middle = "sleep 600 >/dev/null & echo $!; read -r"
    with subprocess.Popen(
        ["bash", "-c", middle], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        orphan = int(parent.stdout.readline())
        with (tmp_path / "usage.csv").open("w") as file:
            last = monitor_resources.sample(file, parent.pid, {})
            parent.communicate("\n")
            again = monitor_resources.sample(file, parent.pid, last)
            stranger = {(pid, began - 1): usage for (pid, began), usage in last.items()}
            never = monitor_resources.sample(file, parent.pid, stranger)
    os.kill(orphan, signal.SIGKILL)
    assert {pid for pid, _ in last} == {parent.pid, orphan}
    assert {pid for pid, _ in again} == {orphan}
    assert never == {}


def test_the_monitor_samples_until_it_is_told_to_stop(tmp_path: Path) -> None:
    out = tmp_path / "usage.csv"
    command = [sys.executable, "-I", "-S", FILES[MONITOR_RESOURCES], out, "--root-pid"]
    with subprocess.Popen([*command, str(os.getpid())]) as monitor:
        eventually(lambda: out.exists() and out.read_text().count("\n") > 1)
        monitor.send_signal(signal.SIGTERM)
        assert monitor.wait(PATIENCE) == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert len({row["timestamp"] for row in rows}) >= 2
    assert {os.getpid(), monitor.pid} <= {int(row["pid"]) for row in rows}


def test_a_verdict_is_xml_whatever_a_scenario_prints(
    driver: SimpleNamespace, tmp_path: Path
) -> None:
    failed = result(
        name='<"it\'s">', result=False, failure_message="a\"b'<", failure_output="\x1b[31m<&\x00]]>"
    )
    driver.write_test_xml(str(tmp_path), [result(), failed])
    suite = ET.parse(tmp_path / "test.xml").getroot()  # noqa: S314
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("2", "1", "0")
    assert suite.get("time") == "3.0"
    cases = suite.findall("testcase")
    assert cases[1].get("name") == '<"it\'s">'
    assert cases[1].findtext("failure") == "[31m<&]]>"
    start = cases[0].find("properties/property")
    assert start is not None
    assert start.get("value") == "1000.250000"
    assert os.listdir(tmp_path) == ["test.xml"]


def test_every_document_is_parsed_alone_under_its_own_folder(
    driver: SimpleNamespace, tmp_path: Path
) -> None:
    path = tmp_path / "scenario.params.yaml"
    documents = [{"try_it": {"text": text, "_output_dir": f"a/{text}"}} for text in ("x", "ü")]
    path.write_text(yaml.safe_dump_all(documents))
    found = [
        (yaml.safe_load(Path(single).read_text()), name, folder)
        for single, name, folder in driver.single_documents(path)
    ]
    assert found == [
        (documents[0], "try_it", "a/x"),
        (documents[1], "try_it", "a/ü"),
    ]


def test_a_post_command_that_fails_is_logged(driver: SimpleNamespace, tmp_path: Path) -> None:
    errors: list[str] = []
    logger = SimpleNamespace(info=lambda _: None, error=errors.append)
    driver.run_post_command("/bin/false", str(tmp_path), logger)
    driver.run_post_command(str(tmp_path / "none"), str(tmp_path), logger)
    assert "failed with code 1" in errors[0]
    assert "cannot run" in errors[1]


def test_a_post_command_that_never_ends_is_killed_with_its_children(
    driver: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "post"
    program.write_text('#!/bin/bash\nsleep 600 &\necho $! >"$1/child"\nwait\n')
    program.chmod(0o755)
    errors: list[str] = []
    logger = SimpleNamespace(info=lambda _: None, error=errors.append)
    monkeypatch.setitem(driver.run_post_command.__globals__, "POST_COMMAND_TIMEOUT", 10)
    driver.run_post_command(str(program), str(tmp_path), logger)
    assert "killed" in errors[0]
    child = Path("/proc") / (tmp_path / "child").read_text().strip() / "stat"
    eventually(lambda: not child.exists() or child.read_text().rpartition(")")[2].split()[0] == "Z")


def test_a_process_that_has_ended_has_no_more_lines(tmp_path: Path) -> None:
    """An orphan stays in the table until its run is over, since the driver adopts it."""
    with subprocess.Popen(["true"]) as ended, (tmp_path / "usage.csv").open("w+") as file:
        os.waitid(os.P_PID, ended.pid, os.WEXITED | os.WNOWAIT)
        sampled = monitor_resources.sample(file, os.getpid(), {})
    assert os.getpid() in {pid for pid, _ in sampled}
    assert ended.pid not in {pid for pid, _ in sampled}
