"""The run contract, with the real entrypoint and the real scenario-execution, as processes."""

from __future__ import annotations

import contextlib
import csv
import fcntl
import os
import re
import shlex
import shutil
import signal
import subprocess
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

import pytest
import yaml
from robovast_testbed import debian
from robovast_testbed.pytest_plugin import skipped_when_unavailable
from support.patience import PATIENCE, eventually

from robovast.campaign.job_log import part_of
from robovast.campaign.verdict import read_test_result
from robovast.execution.contract import contract_files
from robovast.execution.local.process_environment import process_environment

SCENARIO = """
import osc.helpers

scenario try_it:
    program: string = "true"
    do serial:
        run_process(program)
"""


@pytest.fixture(scope="session")
def scenario_execution() -> Path:
    """The folder of the programs of a cached virtual environment with scenario-execution."""
    return process_environment(print) / "bin"


class Script(subprocess.Popen[str]):
    """A script whose end is not waited for without a bound, as `with` does."""

    def __exit__(self, *error: Any) -> None:
        try:
            self.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            os.killpg(self.pid, signal.SIGKILL)
            raise
        finally:
            super().__exit__(*error)


@dataclass
class Job:
    """One job in folders of its own; names hold what shells trip over."""

    root: Path
    programs: Path
    env: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.config = self.root / "con fig's"
        self.out = self.root / 'o"ut $HOME'
        self.output = self.out / "_jobs/job-0"
        self.config.mkdir(parents=True)
        self.out.mkdir()
        for script in contract_files():
            shutil.copy(script, self.config)
        self.write("my scenario.osc", SCENARIO)
        self.env = {
            "PATH": f"{self.programs}:/usr/sbin:/usr/bin:/bin",
            "HOME": str(self.root),
            "CAMPAIGN_ID": "try",
            "SCENARIO_FILE": "my scenario.osc",
            "SCENARIO_PARAMETER_FILE": "scenario.params.yaml",
            "OUTPUT_DIR": str(self.output),
            "ENABLE_X11": "false",
            "ROBOVAST_CONFIG_DIR": str(self.config),
            "ROBOVAST_OUT_DIR": str(self.out),
            **self.env,
        }
        self.single("true")

    def write(self, name: str, text: str) -> Path:
        path = self.config / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        path.chmod(0o755)
        return path

    def program(self, body: str) -> str:
        """Make a program for a scenario to run; returns its path, which has no spaces."""
        path = self.root / "program.sh"
        path.write_text(f"#!/bin/bash\n{body}\n")
        path.chmod(0o755)
        return str(path)

    def sleeper(self) -> str:
        """Make a program that goes on until it is ended; see `begun`."""
        return self.program(f"touch {self.root}/begun; exec sleep 600")

    def begun(self) -> bool:
        """Whether the sleeper has begun, and nothing before it goes on."""
        return (self.root / "begun").exists()

    def single(self, program: str) -> None:
        """Make it a job of one run, `one/0`."""
        self.write("scenario.params.yaml", yaml.safe_dump({"try_it": {"program": program}}))
        self.env["SCENARIO_OUTPUT_DIR"] = str(self.out / "one/0")

    def pack(self, *programs: object) -> None:
        """Make it a job of several runs, `a b/0`, `a b/1`, …, of programs or of parameters."""
        documents = [
            {
                "try_it": {
                    **(program if isinstance(program, dict) else {"program": program}),
                    "_output_dir": f"a b/{index}",
                }
            }
            for index, program in enumerate(programs)
        ]
        self.write("scenario.params.yaml", yaml.safe_dump_all(documents))
        self.env["SCENARIO_OUTPUT_DIR"] = str(self.out)
        self.env["OUTPUT_RESULT_PER_SCENARIO"] = "true"

    def start(self, script: str = "entrypoint.sh", **env: str) -> Script:
        return Script(
            ["/usr/bin/env", "--default-signal=INT", "bash", self.config / script],
            env={**self.env, **env},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )

    def run(self, **env: str) -> tuple[int, str]:
        with self.start(**env) as process:
            output, _ = process.communicate(timeout=PATIENCE)
        return process.returncode, output

    def verdict(self, run: str) -> bool | None:
        """Whether a run passed; None when there is no verdict."""
        path = self.out / run / "test.xml"
        return ET.parse(path).getroot().get("failures") == "0" if path.exists() else None  # noqa: S314

    def log(self, name: str = "system.log") -> str:
        return (self.output / "logs" / name).read_text()

    def is_locked(self) -> bool:
        with contextlib.suppress(FileNotFoundError), (self.out / ".running").open() as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return True
        return False


@pytest.fixture
def job(tmp_path: Path, scenario_execution: Path) -> Iterator[Job]:
    job = Job(tmp_path, scenario_execution)
    yield job
    for process in processes_of(job):
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)


def processes_of(job: Job) -> list[int]:
    """The processes that were started with the job's environment."""
    mark = f"OUTPUT_DIR={job.output}\0".encode()
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if mark in path.read_bytes():
                found.append(int(path.parent.name))
    return found


def test_a_passed_run_leaves_what_the_contract_promises(job: Job) -> None:
    seen = 'until grep -q scenario_execut "$OUTPUT_DIR/resource_usage_main.csv"; do sleep 0.1; done'
    job.single(job.program(seen))
    code, output = job.run(AVAILABLE_CPUS="2", AVAILABLE_MEM="8Gi", INSTANCE_TYPE="it's")
    assert (code, job.verdict("one/0")) == (0, True)
    assert output == job.log()
    assert "Scenario 'try_it' succeeded" in output
    info = yaml.safe_load((job.output / "sysinfo.yaml").read_text())
    assert info.keys() == {
        "platform", "cpu_name", "instance_type", "available_cpus", "available_mem",
    }  # fmt: skip
    assert info["platform"].keys() == {
        "platform", "system", "release", "version", "machine", "processor",
    }  # fmt: skip
    assert (info["available_cpus"], info["available_mem"], info["instance_type"]) == (
        2, "8Gi", "it's",
    )  # fmt: skip
    with (job.output / "resource_usage_main.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert set(rows[0]) == {"timestamp", "pid", "name", "cpu_percent", "memory_rss_bytes"}
    assert any(row["name"].startswith("scenario_execut") for row in rows)
    assert not job.is_locked()
    assert processes_of(job) == []


def test_a_failed_run_is_a_result(job: Job) -> None:
    job.single("false")
    code, _ = job.run()
    assert (code, job.verdict("one/0")) == (1, False)


def test_a_failed_run_of_a_pack_leaves_the_others_alone(job: Job) -> None:
    job.pack("true", "true", "false", "true", "true")
    began = time.time()
    code, _ = job.run()
    verdicts = [job.verdict(f"a b/{index}") for index in range(5)]
    assert (code, verdicts) == (1, [True, True, False, True, True])
    log = job.log().splitlines()
    failed, next_one = (list(part_of(log, f"a b/{number}")) for number in (2, 3))
    assert "Executing scenario 'try_it-2'" in failed[1]
    assert any("execution failed" in line for line in failed)
    assert not any("execution failed" in line for line in next_one)
    assert not (job.out / "test.xml").exists()
    start = ET.parse(job.out / "a b/1/test.xml").find(".//property[@name='start_time']")  # noqa: S314
    assert start is not None
    assert began < float(start.get("value", "0")) < time.time()


def test_a_run_of_a_pack_that_cannot_be_parsed_is_errored_alone(job: Job) -> None:
    job.pack("true", {"no_such_parameter": 1}, "true")
    code, _ = job.run()
    results = [read_test_result(job.out / f"a b/{index}") for index in range(3)]
    assert (code, [r.verdict for r in results]) == (1, ["passed", "errored", "passed"])
    assert results[1].reason.startswith("the scenario cannot be parsed: Scenario Parameter Over")


def test_a_single_run_that_cannot_be_parsed_is_errored(job: Job) -> None:
    job.single("true")
    job.write("my scenario.osc", SCENARIO.replace("program: string", "program: int"))
    assert job.run()[0] == 1
    result = read_test_result(job.out / "one/0")
    assert (result.verdict, result.reason[:30]) == ("errored", "the scenario cannot be parsed:")


def test_a_run_of_a_pack_whose_action_raises_fails_alone(job: Job) -> None:
    job.write("my scenario.osc", SCENARIO.replace("run_process(program)", "run_process(nothing)"))
    job.pack("true", "true")
    code, output = job.run()
    assert (code, job.verdict("a b/0"), job.verdict("a b/1")) == (1, False, False), output


def test_killed_in_the_middle_of_a_pack_earlier_verdicts_are_there(job: Job) -> None:
    job.pack("true", "false", "sleep 600", "true")
    with job.start() as process:
        eventually(lambda: (job.out / "a b/2").exists())
        assert job.is_locked()
        process.kill()
    eventually(lambda: not job.is_locked())
    assert [job.verdict(f"a b/{index}") for index in range(4)] == [True, False, None, None]


def test_a_scenario_that_kills_its_parent_is_an_error(job: Job) -> None:
    job.pack("true", job.program("kill -9 $PPID"), "true")
    code, output = job.run()
    assert code == 137, output
    assert [job.verdict(f"a b/{index}") for index in range(3)] == [True, None, None]
    eventually(lambda: not processes_of(job))  # its parent's killer ends by itself


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_asked_to_stop_a_run_writes_its_result(job: Job, number: signal.Signals) -> None:
    job.single(job.sleeper())
    with job.start() as process:
        eventually(job.begun)
        process.send_signal(number)
        process.communicate(timeout=PATIENCE)
    assert (process.returncode, job.verdict("one/0")) == (1, False)
    assert "Aborted" in (job.out / "one/0/test.xml").read_text()


def test_asked_to_stop_a_pack_ends_and_keeps_its_verdicts(job: Job) -> None:
    job.pack("true", job.sleeper(), "true")
    with job.start() as process:
        eventually(job.begun)
        process.terminate()
        process.communicate(timeout=PATIENCE)
    assert [job.verdict(f"a b/{index}") for index in range(3)] == [True, False, None]


def is_driver(process: int) -> bool:
    """Whether a process executes the runs of a pack."""
    return b"run_scenarios.py" in Path(f"/proc/{process}/cmdline").read_bytes()


def fed(pipe: Path) -> TextIO | None:
    """Where to write what the reader of a named pipe gets; None before there is one."""
    try:
        return os.fdopen(os.open(pipe, os.O_WRONLY | os.O_NONBLOCK), "w")
    except OSError:
        return None


def is_told_to_end(process: int) -> bool:
    """Whether SIGTERM waits for a process that is stopped."""
    status = Path(f"/proc/{process}/status").read_text()
    return bool(int(status.partition("ShdPnd:")[2].split()[0], 16) >> (signal.SIGTERM - 1) & 1)


def test_asked_to_stop_before_its_first_run_a_pack_begins_none(job: Job) -> None:
    """What has a folder has begun, for whoever judges runs, and for the job that comes next."""
    job.pack("true", "true")
    parameters = job.config / "scenario.params.yaml"
    text = parameters.read_text()
    parameters.unlink()
    os.mkfifo(parameters)
    with job.start() as process:
        with eventually(lambda: fed(parameters)) as feed:
            (driver,) = (pid for pid in processes_of(job) if is_driver(pid))
            os.kill(driver, signal.SIGSTOP)
            # bash can miss one request, while it handles the signal that its child has stopped
            eventually(lambda: process.terminate() or is_told_to_end(driver))
            os.kill(driver, signal.SIGCONT)
            feed.write(text)
        process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert [path.name for path in job.out.iterdir() if path.name == "a b"] == []
    assert not (job.output / "finished_runs").exists()


def test_the_pre_command_sets_the_environment_of_the_run(job: Job) -> None:
    job.write("files/pre.sh", 'export GREETING="it\'s $(pwd)"\n')
    job.single(job.program('[[ $GREETING == "it\'s "* ]]'))
    assert job.run()[0] == 1
    assert job.run(PRE_COMMAND="/config/files/pre.sh")[0] == 0


@pytest.mark.parametrize("end", ["false", "return 3", "exit 3", "exit 0", "set -eu; false"])
def test_a_failed_pre_command_fails_the_job(job: Job, end: str) -> None:
    job.write("pre.sh", f"echo about to fail\n{end}\n")
    code, output = job.run(PRE_COMMAND="/config/pre.sh")
    assert (code, job.verdict("one/0")) == (70, None)
    assert "about to fail" in output
    assert "the pre command" in output
    assert processes_of(job) == []


def test_asked_to_stop_while_the_pre_command_runs(job: Job) -> None:
    job.write("pre.sh", "echo started\nsleep 600\n")
    with job.start(PRE_COMMAND="/config/pre.sh") as process:
        eventually(lambda: (job.output / "logs/system.log").exists())
        eventually(lambda: "started" in job.log())
        process.terminate()
        process.communicate(timeout=PATIENCE)
    assert process.returncode == 143
    assert processes_of(job) == []


def test_the_post_command_gets_the_folder_of_each_run(job: Job) -> None:
    job.write("post.sh", '#!/bin/bash\ncp "$1/test.xml" "$1/seen.xml"\n')
    job.run(POST_COMMAND="/config/post.sh")
    assert (job.out / "one/0/seen.xml").exists()
    job.pack("true", "false")
    job.run(POST_COMMAND="/config/post.sh")
    for run in ("a b/0", "a b/1"):
        assert (job.out / run / "seen.xml").read_bytes() == (
            job.out / run / "test.xml"
        ).read_bytes()


def test_each_run_of_a_pack_and_its_post_command_have_its_own_seed(job: Job) -> None:
    job.write("scenario.seeds.json", '{"a b/0": 17, "a b/1": 0}')
    job.write("post.sh", '#!/bin/bash\necho "$ROBOVAST_SEED" >"$1/post"\n')
    job.pack(*[job.program(f'echo "$ROBOVAST_SEED" >>{job.root}/seen')] * 2)
    assert job.run(POST_COMMAND="/config/post.sh")[0] == 0
    assert (job.root / "seen").read_text() == "17\n0\n"
    assert [(job.out / f"a b/{n}/post").read_text() for n in (0, 1)] == ["17\n", "0\n"]


def test_runs_of_a_pack_are_told_when_they_are_over(job: Job) -> None:
    told = job.output / "finished_runs"
    job.write("post.sh", '#!/bin/bash\nsleep 0.3\necho done >"$1/post"\n')
    job.pack("true", job.sleeper())
    with job.start(POST_COMMAND="/config/post.sh") as process:
        eventually(job.begun)
        assert (job.out / "a b/0/post").read_text() == "done\n"
        assert (job.verdict("a b/0"), told.read_text()) == (True, "a b/0\n")
        process.terminate()
        process.communicate(timeout=PATIENCE)
    assert told.read_text() == "a b/0\na b/1\n"


def test_what_a_run_of_a_pack_started_ends_with_it(job: Job) -> None:
    job.write(
        "my scenario.osc",
        SCENARIO.replace("run_process(program)", "run_process(program, wait_for_shutdown: false)"),
    )
    job.pack("sleep 61", "sleep 62")
    code, _ = job.run()
    assert (code, processes_of(job)) == (0, [])


LEAVES = """\
exec </dev/null >/dev/null 2>&1
setsid bash -c 'trap "" TERM; cd /; exec env -i sleep {0}1' &
(trap '' TERM HUP; sleep {0}2 & sleep {0}3) &
until [ -e {1} ]; do sleep 0.05; done
"""


@pytest.fixture
def seconds() -> str:
    """How long a process of this test sleeps, and of no other; digits may be appended."""
    return f"45.{time.time_ns()}"


def sleeping(seconds: str) -> set[str]:
    """The digits appended to it in the arguments of what sleeps."""
    found = set()
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            name, _, arguments = path.read_bytes().decode("utf-8", "replace").partition("\0")
            if name == "sleep" and arguments.startswith(seconds):
                found.add(arguments[len(seconds) : -1])
    return found


def test_whatever_a_run_of_a_pack_leaves_behind_ends_before_it_is_over(
    job: Job, seconds: str
) -> None:
    """Daemons that ignore signals, know nothing of the job, and lost their parents."""
    job.write("pre.sh", f"sleep {seconds}0 &\n")
    seen = job.root / "seen"
    job.pack(job.program(LEAVES.format(seconds, shlex.quote(str(seen)))), "sleep 600")
    told = job.output / "finished_runs"
    with job.start(PRE_COMMAND="/config/pre.sh") as process:
        eventually(lambda: sleeping(seconds) == {"0", "1", "2", "3"})
        seen.touch()
        eventually(lambda: told.exists())
        assert sleeping(seconds) == {"0"}, "the pre command is no run's"
        process.terminate()
        process.communicate(timeout=PATIENCE)


def test_what_a_post_command_leaves_behind_ends_too(job: Job, seconds: str) -> None:
    job.write("post.sh", f"#!/bin/bash\nsetsid sleep {seconds} </dev/null >/dev/null 2>&1 &\n")
    job.pack("true", "true")
    assert job.run(POST_COMMAND="/config/post.sh")[0] == 0
    assert sleeping(seconds) == set()


def test_a_post_command_that_cannot_be_run_is_found_before_the_run(job: Job) -> None:
    code, output = job.run(POST_COMMAND="/config/none.sh")
    assert (code, job.verdict("one/0")) == (70, None)
    assert "none.sh is not an executable file" in output


def test_each_missing_tool_is_named(job: Job) -> None:
    tools = job.root / "tools"
    tools.mkdir()
    for name in ("bash", "mkdir", "tee", "flock", "find", "python3"):
        (tools / name).symlink_to(Path("/usr/bin") / name)
    code, output = job.run(PATH=str(tools), ENABLE_X11="true")
    assert code == 69
    assert "lacks: stdbuf Xvfb start-stop-daemon" in output


def test_only_the_tools_of_the_contract_are_needed(job: Job) -> None:
    tools = job.root / "tools"
    tools.mkdir()
    for name in ("bash", "mkdir", "tee", "find", "stdbuf", "python3", "true"):
        (tools / name).symlink_to(Path("/usr/bin") / name)
    code, output = job.run(PATH=f"{job.programs}:{tools}")
    assert (code, job.verdict("one/0")) == (0, True), output
    assert "not found" not in output


def test_a_missing_executor_is_named(job: Job) -> None:
    code, output = job.run(PATH="/usr/bin:/bin")
    assert code == 69
    assert "no scenario-execution" in output


def test_an_output_folder_that_cannot_be_written_is_named(job: Job) -> None:
    (job.out / "one").write_text("a file where a folder should be")
    code, output = job.run()
    assert code == 73
    assert f"cannot write the output folder {job.out / 'one/0'}" in output


def test_two_jobs_do_not_share_a_folder(job: Job) -> None:
    with (job.out / ".running").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        code, output = job.run()
    assert code == 73
    assert "another job runs" in output


def test_the_log_is_complete_although_the_machine_is_slow(job: Job) -> None:
    """As on a machine that is so busy that who writes the log gets no CPU before the job ends."""
    slow = job.root / "slow"
    slow.mkdir()
    (slow / "tee").write_text(f'#!/bin/bash\nsleep 4\nexec {shutil.which("tee")} "$@"\n')
    (slow / "tee").chmod(0o755)
    job.single(job.program("(setsid sleep 60 &); echo its last words"))
    code, output = job.run(PATH=f"{slow}:{job.env['PATH']}")
    assert code == 0
    assert "its last words" in output
    assert job.log() == output
    assert job.log().endswith("ended with code 0\n")


def test_the_lock_is_released_although_daemons_stay_behind(job: Job) -> None:
    job.write("pre.sh", "(trap '' TERM; while sleep 1; do :; done) &\n")
    job.single(job.program("setsid sleep 60 </dev/null >/dev/null 2>&1 &"))
    code, _ = job.run(PRE_COMMAND="/config/pre.sh")
    assert code == 0
    assert len(processes_of(job)) >= 1
    assert not job.is_locked()


def test_a_secondary_runs_until_the_main_container_ends(job: Job) -> None:
    job.write(
        "pre.sh", 'if [[ $CONTAINER_NAME ]]; then echo "$CONTAINER_NAME is up"; exec sleep 60; fi\n'
    )
    seen = 'until grep -q sleep "$OUTPUT_DIR/resource_usage_nav.csv"; do sleep 0.1; done'
    job.single(job.program(seen))
    job.env["PRE_COMMAND"] = "/config/pre.sh"
    with job.start("secondary_entrypoint.sh", CONTAINER_NAME="nav") as secondary:
        code, _ = job.run()
        assert code == 0
        secondary.communicate(timeout=PATIENCE)
    assert secondary.returncode == 0
    assert "nav is up" in job.log("system_nav.log")
    assert "sleep" in (job.output / "resource_usage_nav.csv").read_text()
    assert processes_of(job) == []


def test_a_secondary_stops_when_told(job: Job) -> None:
    job.write("pre.sh", "sleep 60 &\n")
    with job.start(
        "secondary_entrypoint.sh", CONTAINER_NAME="nav", PRE_COMMAND="/config/pre.sh"
    ) as secondary:
        eventually(lambda: (job.output / "resource_usage_nav.csv").exists())
        secondary.terminate()
        secondary.communicate(timeout=PATIENCE)
    assert secondary.returncode == 0
    eventually(lambda: processes_of(job) == [])


def test_a_secondary_whose_pre_command_fails_ends(job: Job) -> None:
    job.write("pre.sh", "return 3\n")
    with job.start(
        "secondary_entrypoint.sh", CONTAINER_NAME="nav", PRE_COMMAND="/config/pre.sh"
    ) as secondary:
        secondary.communicate(timeout=PATIENCE)
    assert secondary.returncode == 70
    assert "failed with code 3" in job.log("system_nav.log")
    eventually(lambda: processes_of(job) == [])


def test_pre_command_and_run_find_what_image_and_document_say(job: Job) -> None:
    """Whatever the entrypoint calls its own variables and functions."""
    text = "".join(script.read_text() for script in contract_files() if script.suffix == ".sh")
    given = dict.fromkeys(set(re.findall(r"\b[a-z]\w*\b", text)), "the image's")
    job.env |= given
    job.write("pre.sh", 'env -0 >"$ROBOVAST_OUT_DIR/pre${CONTAINER_NAME}_command"\n')
    job.single(job.program('env -0 >"$ROBOVAST_OUT_DIR/run"'))
    with job.start("secondary_entrypoint.sh", CONTAINER_NAME="nav", PRE_COMMAND="/config/pre.sh"):
        eventually(lambda: (job.out / "prenav_command").exists())
        assert job.run(PRE_COMMAND="/config/pre.sh")[0] == 0
    for name in ("prenav_command", "pre_command", "run"):
        found = dict(
            line.split("=", 1) for line in (job.out / name).read_text().split("\0") if line
        )
        assert {key for key, value in given.items() if found.get(key) != value} == set(), name


def test_a_pre_command_may_use_any_name_and_trap(job: Job) -> None:
    job.write(
        "pre.sh",
        "config= out= logs= code=9 command= executor= contract= child= monitor= root=\n"
        "set -- some arguments\ntrap 'echo from the trap' EXIT\nsleep 60 &\n",
    )
    code, output = job.run(PRE_COMMAND="/config/pre.sh")
    assert (code, job.verdict("one/0")) == (0, True), output
    assert (job.output / "resource_usage_main.csv").stat().st_size > 0
    assert processes_of(job) == []


def test_a_signal_to_the_whole_group_is_heard_once(job: Job) -> None:
    job.pack(job.sleeper(), "true")
    with job.start() as process:
        eventually(job.begun)
        os.killpg(process.pid, signal.SIGTERM)
        process.communicate(timeout=PATIENCE)
    assert [job.verdict("a b/0"), job.verdict("a b/1")] == [False, None]
    assert (job.out / "a b/0/test.xml").read_text().count("<testcase") == 1


SIMULATION = """
class Steps:
    dt = 0.1
    def setup(self, **kwargs): print("simulation set up")
    def reset(self): print("simulation reset")
    def step(self): pass
    def is_done(self): return False
    def shutdown(self): print("simulation shut down")
"""


def test_a_pack_in_one_simulation(job: Job) -> None:
    job.write("steps.py", SIMULATION)
    job.pack("true", "false", "true")
    code, output = job.run(SIMULATION="steps:Steps", PYTHONPATH=str(job.config))
    verdicts = [job.verdict(f"a b/{index}") for index in range(3)]
    assert (code, verdicts) == (1, [True, False, True]), output
    assert (output.count("simulation set up"), output.count("simulation reset")) == (1, 3)
    assert (job.output / "finished_runs").read_text() == "a b/0\na b/1\na b/2\n"


def test_what_a_simulation_starts_lives_as_long_as_it(job: Job, seconds: str) -> None:
    server = f'subprocess.Popen(["sleep", "{seconds}1"])'
    start = f'self.servers = [*getattr(self, "servers", []), {server}]'
    check = "assert all(one.poll() is None for one in self.servers), 'a server has ended'"
    text = "import subprocess\n" + SIMULATION
    text = text.replace('print("simulation set up")', start)
    text = text.replace('print("simulation reset")', start).replace("pass", check)
    text = text.replace('print("simulation shut down")', "[one.kill() for one in self.servers]")
    job.write("steps.py", text)
    job.pack(*[job.program(f"setsid sleep {seconds}2 </dev/null >/dev/null 2>&1 &")] * 3)
    code, output = job.run(SIMULATION="steps:Steps", PYTHONPATH=str(job.config))
    assert (code, [job.verdict(f"a b/{n}") for n in range(3)]) == (0, [True] * 3), output
    assert sleeping(seconds) == set()


def install(job: Job, name: str, text: str) -> None:
    """Put a program before all others on the job's PATH."""
    path = job.root / "bin dir" / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)
    job.env["PATH"] = f"{path.parent}:{job.programs}:/usr/sbin:/usr/bin:/bin"


def test_an_executor_whose_interpreter_has_spaces_is_driven_too(job: Job) -> None:
    original = (job.programs / "scenario_execution").read_text()
    install(job, "python3", f'#!/bin/bash\nexec {job.programs}/python3 "$@"\n')
    trick = f"#!/bin/sh\n'''exec' '{job.root}/bin dir/python3' \"$0\" \"$@\"\n' '''\n"
    install(job, "scenario_execution", trick + original.partition("\n")[2])
    job.pack("true", "false")
    code, output = job.run()
    assert (code, job.verdict("a b/0"), job.verdict("a b/1")) == (1, True, False)
    assert "warning" not in output
    assert (job.output / "finished_runs").exists()


def test_an_executor_that_is_no_python_program_runs_as_it_is(job: Job) -> None:
    install(
        job, "scenario_execution", f'#!/bin/bash\nexec {job.programs}/scenario_execution "$@"\n'
    )
    job.pack("true", "false")
    code, output = job.run()
    assert (code, job.verdict("a b/0"), job.verdict("a b/1")) == (1, True, False)
    assert "warning" in output


def test_an_unknown_scenario_execution_runs_as_it_is(job: Job) -> None:
    package = job.root / "lib/scenario_execution"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "scenario_execution_base.py").write_text(
        "class ScenarioExecution:\n    def run(self, loop): pass\ndef main(): print('as it is')\n"
    )
    job.pack("true")
    code, output = job.run(PYTHONPATH=str(package.parent))
    assert code == 0, output
    assert "warning: this image's scenario-execution is not as expected" in output
    assert "as it is\n" in output


def test_with_ros_the_package_runs_and_rosout_is_recorded(job: Job) -> None:
    prefix = job.root / "ws"
    program = prefix / "lib/scenario_execution_ros/scenario_execution_ros"
    program.parent.mkdir(parents=True)
    shutil.copy(job.programs / "scenario_execution", program)
    install(
        job,
        "ros2",
        "#!/bin/bash\ntrap 'echo closed >\"$6/metadata.yaml\"; exit' INT\n"
        'mkdir "$6"\necho "$@" >"$6/called"\nwhile sleep 0.05; do :; done\n',
    )
    recorded = 'until [ -e "$OUTPUT_DIR/logs/rosout_bag/called" ]; do sleep 0.05; done'
    job.single(job.program(recorded))
    code, output = job.run(AMENT_PREFIX_PATH=f"/no/where:{prefix}")
    assert (code, job.verdict("one/0")) == (0, True), output
    assert str(program) in output
    bag = job.output / "logs/rosout_bag"
    assert (bag / "called").read_text() == f"bag record -s mcap -o {bag} /rosout\n"
    assert (bag / "metadata.yaml").read_text() == "closed\n"
    assert processes_of(job) == []


def test_a_display_is_there_unless_it_is_not_wanted(job: Job) -> None:
    with skipped_when_unavailable():
        debian.require("Xvfb")
    job.single(job.program("[[ -S /tmp/.X11-unix/X${DISPLAY#:} ]]"))
    code, output = job.run(ENABLE_X11="true")
    assert code == 0, output
    eventually(lambda: processes_of(job) == [])  # an X server that is told to end takes its time
    assert job.run(DISPLAY=":98765")[0] == 1
