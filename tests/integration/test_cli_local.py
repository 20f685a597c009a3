"""`vast` as a program of its own: a campaign from the command line, signals, pipes, terminals."""

from __future__ import annotations

import os
import pty
import re
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from support.campaigns.local import make_campaign
from support.patience import PATIENCE, eventually
from support.terminal import read_all, shown_on_terminal

VAST = Path(sys.executable).with_name("vast")

PASS = "exit 0\n"
FAIL_SECOND = '[ "$1" != 2 ]\n'
NO_RESULT_SECOND = '[ "$1" != 2 ] || kill -9 $PPID\n'
SLOW = "sleep 600\n"


def vast(*arguments: object, cwd: Path, **settings: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(  # type: ignore[call-overload,no-any-return]
        [VAST, *map(str, arguments)], cwd=cwd, capture_output=True, text=True, **settings
    )


def test_a_campaign_passes_from_init_to_results(tmp_path: Path) -> None:
    make_campaign(tmp_path / "in", PASS)
    assert vast("init", "in/test.vast", cwd=tmp_path).returncode == 0
    result = vast("exec", "local", "run", "--runtime", "process", "-r", 2, cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    lines = result.stdout.splitlines()
    (campaign,) = (tmp_path / "results").iterdir()
    assert lines[-2:] == ["6 runs: 6 passed.", f"Results: results/{campaign.name}"]
    assert sum(line.startswith("[") and " passed " in line for line in lines) == 6


@pytest.mark.parametrize(
    ("script", "code", "verdict", "reason"),
    [
        (FAIL_SECOND, 1, "failed", "run_process: bash step.sh 2 failed with 1"),
        (NO_RESULT_SECOND, 4, "errored", "the run wrote no test.xml; it was ended by SIGKILL"),
    ],
)
def test_runs_that_do_not_pass_are_named_with_their_log(
    tmp_path: Path, script: str, code: int, verdict: str, reason: str
) -> None:
    file = make_campaign(tmp_path / "in", script)
    result = vast(
        "-V", file, "exec", "local", "run", "out", "--runtime", "process", cwd=tmp_path
    )  # fmt: skip
    assert result.returncode == code, result.stdout
    summary = result.stdout.partition("\n\n")[2].splitlines()
    assert summary[0].startswith(f"{verdict:<8}   1 × {reason}")
    log = tmp_path / summary[0].partition("  one-2/0 (")[2].removesuffix(")")
    assert log.name == "system.log"
    assert log.is_file()
    assert summary[-2] == f"3 runs: 2 passed, 1 {verdict}."


def test_an_interrupted_campaign_ends_soon_and_is_resumed(tmp_path: Path) -> None:
    file = make_campaign(tmp_path / "in", SLOW)
    with subprocess.Popen(
        [VAST, "-V", file, "exec", "local", "run", "out", "--runtime", "process", "-j", "1"],
        cwd=tmp_path, stdout=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        eventually(lambda: any((tmp_path / "out").glob("*/.running/job-*/out/*")))
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    (campaign,) = (tmp_path / "out").iterdir()
    assert f"Continue: vast exec local run --resume out/{campaign.name}" in out
    (campaign / "_config/files/step.sh").write_text(PASS)
    resumed = vast(
        "exec", "local", "run", "--resume", campaign, "--runtime", "process", cwd=tmp_path
    )
    assert resumed.returncode == 0, resumed.stdout + resumed.stderr
    assert "3 runs: 3 passed." in resumed.stdout


def test_a_terminal_shows_a_live_view(tmp_path: Path) -> None:
    file = make_campaign(tmp_path / "in", FAIL_SECOND)
    command = [VAST, "-V", file, "exec", "local", "run", "out", "--runtime", "process"]
    code, text = shown_on_terminal(command, tmp_path)
    shown = re.sub(r"\x1b\[[0-9;]*m", "", text)
    assert code == 1
    assert "running: one-" in shown
    assert "failed  one-2/0: " in shown
    assert "3 runs: 2 passed, 1 failed." in shown


def test_a_campaign_goes_on_when_nobody_reads_its_lines(tmp_path: Path) -> None:
    file = make_campaign(tmp_path / "in", PASS)
    process = subprocess.Popen(
        [VAST, "-V", file, "exec", "local", "run", "out", "--runtime", "process"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.readline()
    process.stdout.close()
    assert (process.wait(PATIENCE), process.stderr.read()) == (0, "")
    process.stderr.close()
    assert len(list((tmp_path / "out").glob("*/one-*/0/run.json"))) == 3


def test_a_reader_that_goes_away_is_no_error(tmp_path: Path) -> None:
    file = make_campaign(tmp_path / "in", PASS)
    reading, writing = os.pipe()
    os.close(reading)
    result = subprocess.run(
        [VAST, "-V", file, "config", "list"], stdout=writing, stderr=subprocess.PIPE, check=False
    )
    os.close(writing)
    assert (result.returncode, result.stderr) == (141, b"")


def test_exploding_aliases_are_refused_at_once_in_little_memory(tmp_path: Path) -> None:
    lines = ["version: 1", "metadata:", "  a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    for level in range(1, 10):
        items = ", ".join([f"*a{level - 1}"] * 10)
        lines.append(f"  a{level}: &a{level} [{items}]")
    (tmp_path / "boom.vast").write_text("\n".join([*lines, ""]))

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (400 << 20, 400 << 20))
        resource.setrlimit(resource.RLIMIT_CPU, (10, 10))

    result = vast("-V", "boom.vast", "config", "list", cwd=tmp_path, preexec_fn=limit)
    assert result.returncode == 2
    place, _, problem = result.stderr.partition(": ")
    assert place.startswith("boom.vast:")
    assert "its aliases (`*name`) repeat more than 100,000 values" in problem


def test_prepare_run_leaves_a_script(tmp_path: Path) -> None:
    file = make_campaign(tmp_path / "in", PASS)
    result = vast(
        "-V", file, "exec", "local", "prepare-run", "-c", "one-2", "-t", "run", cwd=tmp_path
    )
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.startswith("Run run/run.sh. ")
    assert os.access(tmp_path / "run" / "run.sh", os.X_OK)
    configurations = yaml.safe_load(
        (tmp_path / "run/out_template/_transient/configurations.yaml").read_text()
    )
    assert [config["name"] for config in configurations["configs"]] == ["one-2"]


def test_a_configuration_in_the_place_of_the_folder_is_asked_about(tmp_path: Path) -> None:
    file = make_campaign(tmp_path / "in", PASS)
    command = [VAST, "-V", file, "exec", "local", "run", "one-2", "--runtime", "process"]
    refused = subprocess.run(command, cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True)
    assert (refused.returncode, b"hint: use `--config 'one-2'`" in refused.stderr) == (2, True)
    assert not (tmp_path / "one-2").exists()
    for answer, total in ((b"\n", b"1 run:"), (b"n\n", b"3 runs:")):
        main, other = pty.openpty()
        process = subprocess.Popen(command, cwd=tmp_path, stdin=other, stdout=subprocess.PIPE)
        os.close(other)
        os.write(main, answer)
        out, _ = process.communicate(timeout=PATIENCE)
        os.close(main)
        assert total in out
    assert len(list((tmp_path / "results").iterdir())) == 1
    assert len(list((tmp_path / "one-2").iterdir())) == 1


def test_campaigns_that_start_in_one_second_both_work(tmp_path: Path) -> None:
    file = make_campaign(tmp_path / "in", PASS)
    command = [VAST, "-V", file, "exec", "local", "run", "out", "--runtime", "process"]
    processes = [
        subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL) for _ in range(4)
    ]
    assert [process.wait(PATIENCE) for process in processes] == [0] * 4
    assert len(list((tmp_path / "out").iterdir())) == 4


SLEEPER = """\
import pathlib, time
from robovast.common.variation import Variation


class Sleep(Variation):
    def variation(self, in_configs):
        self.progress_update("measuring the floor")
        time.sleep(2.5)
        while pathlib.Path({held!r}).exists():
            time.sleep(0.05)
        return [self.update_config(config, {{"x": 1}}) for config in in_configs]
"""


def test_what_takes_its_time_is_shown_on_a_terminal_alone(tmp_path: Path) -> None:
    file = make_campaign(tmp_path / "in", PASS)
    held = tmp_path / "held"
    held.touch()
    (file.parent / "sleep.py").write_text(SLEEPER.format(held=str(held)))
    file.write_text(file.read_text().replace("ParameterVariationList: {name: x, values: [1, 2, 3]}",
                                             "sleep.py:Sleep"))  # fmt: skip
    command = [VAST, "-V", file, "config", "list", "-o", "name"]
    main, other = pty.openpty()
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=other)
    os.close(other)
    begin = b""
    while b"measuring the floor" not in begin:
        begin += os.read(main, 65536)
    held.unlink()
    shown = begin.decode() + read_all(main)
    assert process.communicate(timeout=PATIENCE)[0] == b"one-1\n"
    assert re.search(r"Expanding test\.vast … \d+ s  Sleep: measuring the floor", shown)
    assert shown.endswith("\r\x1b[K")
    silent = subprocess.run(command, cwd=tmp_path, capture_output=True, check=True)
    assert (silent.stdout, silent.stderr) == (b"one-1\n", b"")
