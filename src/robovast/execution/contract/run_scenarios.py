"""Run a pack of scenarios in one process, verdict by verdict.

    python run_scenarios.py EXECUTOR [ARGUMENT]...

EXECUTOR is scenario-execution's own program, the arguments are its own. It runs in this process,
unchanged but for what a pack needs:

- Each test.xml appears, complete, as soon as its scenario has ended. scenario-execution itself
  writes all of them after the last one, so that a crash in run 17 of 20 would lose 16 verdicts.
- A line of the log, `[robovast] run FOLDER`, says which run the lines after it belong to.
- What a scenario started is shut down before the next one begins.
- The post command (`--post-run`) runs once per run, with that run's folder.
- Whatever processes a run and its post command leave behind are ended, so that none changes the
  run's files once others have taken them. What was there before the first run stays, and so does
  what a step-based simulation starts when it is set up or reset.
- ROBOVAST_SEED is that of the run, for all that it starts (scenario.seeds.json has them all).
- Each run that is over, post command included, gets a line in $OUTPUT_DIR/finished_runs: its
  folder, relative to the output folder of the pack.
- A setup or a tick that raises fails its own run only; a parameter document that is wrong leaves
  only its own run without a verdict.
- A request to stop ends the pack, not only the scenario that runs.
- The loop does not sleep one more tick after a scenario has ended.

Where scenario-execution looks different from what is known here, it runs as it is, with a warning.
A runner for other middleware keeps its own loop, and so does a step-based simulation; there, a
setup that raises ends the pack.

Runs in images of any origin: standard library of Python 3.8 and what scenario-execution brings.
"""

# ruff: noqa: E402  # where modules come from must be settled before they are imported
from __future__ import annotations

import os
import sys

# Modules come from where the executor finds them; the folder of this file is the user's.
sys.path[0] = os.path.dirname(os.path.abspath(sys.argv[1]))

import contextlib
import gc
import importlib
import inspect
import json
import runpy
import signal
import subprocess
import tempfile
import time
import types
from xml.sax.saxutils import escape, quoteattr

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator
    from typing import Any

POST_COMMAND_TIMEOUT = 600
"""Seconds, as many as scenario-execution grants."""

ENDING = ((signal.SIGTERM, 2.0), (signal.SIGKILL, 10.0))
"""Signals to what runs leave behind, and how long it may take to end [s]."""

PR_SET_CHILD_SUBREAPER = 36
"""Of prctl: a process whose parent has ended becomes a child of the caller."""

PARSING_FAILED = "parsing failed"
"""The failure message that scenario-execution gives to a scenario that it cannot parse: that run
never begins, and is errored."""

STOPPED = "Aborted"
"""The failure message that scenario-execution gives to a run that was asked to stop."""

EXPECTED = {
    "parse": ["self"],
    "run": ["self"],
    "setup": ["self", "scenario", "current_output_dir", "kwargs"],
    "add_result": ["self", "result"],
    "process_results": ["self"],
    "fail_from_exception": ["self", "failure_message", "e"],
}
"""Parameters of the methods of ScenarioExecution that are replaced or called here."""


def printable(text: str) -> str:
    """Return the text without the control characters (colours) that XML cannot hold."""
    return "".join(character for character in text if character >= " " or character in "\t\n\r")


def test_case(result: Any) -> Iterator[str]:
    """Return one result as lines of JUnit XML."""
    duration = result.processing_time.total_seconds()
    name = quoteattr(result.name)
    yield f'  <testcase classname="tests.scenario" name={name} time="{duration}">'
    if result.start_time:
        yield "    <properties>"
        yield f'      <property name="start_time" value="{result.start_time.timestamp():.6f}"/>'
        yield "    </properties>"
    if not result.result:
        message = quoteattr(printable(result.failure_message))
        yield f"    <failure message={message}>{escape(printable(result.failure_output))}</failure>"
    yield "  </testcase>"


def test_suite(results: list[Any]) -> Iterator[str]:
    """Return the results of one run as lines of JUnit XML."""
    failures = sum(not result.result for result in results)
    duration = sum(result.processing_time.total_seconds() for result in results)
    yield '<?xml version="1.0" encoding="utf-8"?>'
    yield (
        f'<testsuite errors="0" failures="{failures}" name="scenario_execution" '
        f'tests="{len(results)}" time="{duration}">'
    )
    for result in results:
        yield from test_case(result)
    yield "</testsuite>"


def write_test_xml(folder: str, results: list[Any]) -> None:
    """Write a run's verdict; it appears complete or not at all."""
    rewrite(os.path.join(folder, "test.xml"), test_suite(results))


def rewrite(path: str, lines: Iterable[str]) -> None:
    """Write a file, complete or not at all, whatever (a pipe, a link) a run put in its place."""
    part = path + ".part"
    with contextlib.suppress(FileNotFoundError):
        os.remove(part)
    with open(part, "x", encoding="utf-8") as file:
        file.writelines(line + "\n" for line in lines)
    os.replace(part, path)


def run_post_command(command: str, folder: str, logger: Any) -> None:
    """Run a post command on a run's folder; what goes wrong is logged and changes no verdict."""
    logger.info(f"Running post command: {command} {folder}")
    try:
        # A session of its own, so that it can be ended with all that it started.
        process = subprocess.Popen([command, folder], start_new_session=True)
        code = process.wait(POST_COMMAND_TIMEOUT)
    except OSError as error:
        logger.error(f"Post command {command} cannot run: {error}")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        logger.error(f"Post command {command} took more than {POST_COMMAND_TIMEOUT} s, killed.")
    else:
        if code != 0:
            logger.error(f"Post command {command} failed with code {code}.")


def single_documents(path: str) -> Iterator[tuple[str, str, str]]:
    """Yield (file, scenario name, output folder) for each document of a parameter file alone."""
    yaml = importlib.import_module("yaml")
    with open(path, encoding="utf-8") as stream:
        documents = [document for document in yaml.safe_load_all(stream) if document]
    for document in documents:
        name, parameters = next(iter(document.items()))
        with tempfile.NamedTemporaryFile("w", suffix=".yaml", encoding="utf-8") as file:
            yaml.safe_dump(document, file, allow_unicode=True)
            file.flush()
            yield file.name, name, parameters["_output_dir"]


def unparsable(name: str, reason: str) -> Any:
    """Return a tree that takes the place of a scenario and cannot be set up for this reason."""
    tree = importlib.import_module("py_trees").behaviours.Failure(name)

    def setup(**_: Any) -> None:
        raise ValueError(reason)

    tree.setup, tree.failure_message = setup, PARSING_FAILED
    return tree


def parse_one_by_one(execution: Any) -> None:
    """Parse each document of the parameter file alone, since one of them at least is wrong."""
    scenarios: list[Any] = []
    for path, name, folder in single_documents(execution.scenario_parameter_file):
        execution.scenario_parameter_file = path
        if original.parse(execution):
            scenarios += execution.scenarios_list
        else:
            failure = execution.results.pop()
            scenarios.append((unparsable(name, failure.failure_output), {}, folder))
    execution.scenarios_list = scenarios


class PatchedScenarioExecution:
    """Methods that take the place of those of ScenarioExecution, whose instance `self` is."""

    def parse(self: Any) -> bool:
        """Parse; a document that is wrong becomes a run without verdict."""
        if not original.parse(self):
            self.results.clear()
            parse_one_by_one(self)
        if self.simulation is not None:
            finish_before_reset(self)
        if state.stopped:  # meanwhile: no run begins, nor leaves a folder as if it had
            self.scenarios_list.clear()
        return bool(self.scenarios_list)

    def run(self: Any) -> None:
        """Run one scenario after the other, whatever becomes of each."""
        if self.simulation is not None:
            original.run(self)
            return
        for tree, _, folder in self.scenarios_list:
            finish_runs(self)
            folder = os.path.join(self.output_dir, folder or tree.name)
            os.makedirs(folder, exist_ok=True)
            try:
                self.setup(tree, current_output_dir=folder)
                tick_until_over(self)
            except Exception as error:
                self.fail_from_exception("Run failed", error)
            shut_down(self)

    def setup(self: Any, scenario: Any, current_output_dir: Any = None, **kwargs: Any) -> None:
        """Set a scenario up; the one before is over, and a verdict of an earlier attempt goes."""
        gc.enable()
        finish_runs(self)
        if state.kept is None:
            state.kept = frozenset(descendants())
        folder = current_output_dir or self.output_dir
        run = os.path.relpath(folder, self.output_dir)
        if run != ".":
            sys.stdout.write(f"[robovast] run {run}\n")
            sys.stdout.flush()
        set_seed(folder)
        verdict = os.path.join(folder, "test.xml")
        if os.path.exists(verdict):
            os.remove(verdict)
        original.setup(self, scenario, current_output_dir=current_output_dir, **kwargs)

    def add_result(self: Any, result: Any) -> None:
        """Keep a result and write its verdict at once."""
        if result.failure_message == STOPPED:
            state.stopped = True
            self.scenarios_list.clear()  # ends the loop over it, whichever that is
        run = [one for one in self.results if one.output_dir == result.output_dir]
        if any(one.name == result.name for one in run):
            return  # asked to stop when the scenario had just ended: its verdict stands
        if hasattr(self.current_scenario, "failure_message") and not state.stopped:
            result.failure_message = self.current_scenario.failure_message
        original.add_result(self, result)
        if result.output_dir is not None:  # else it is not a run's result, see parse
            write_test_xml(result.output_dir, [*run, result])
            state.ended.append(result.output_dir)

    def process_results(self: Any) -> bool:
        """Return whether all passed; every verdict is written already."""
        finish_runs(self)
        return bool(self.results) and all(one.result for one in self.results)


def read_seeds() -> dict[str, int]:
    """Return the seeds of runs by folder; none where nobody has given any."""
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "scenario.seeds.json")
    if not os.path.exists(path):
        return {}
    with open(path, encoding="utf-8") as file:
        return dict(json.load(file))


def set_seed(folder: str) -> None:
    """Set the seed of the run that writes into a folder, where it has one."""
    run = os.path.relpath(folder, os.environ["ROBOVAST_OUT_DIR"])
    if run in state.seeds:
        os.environ["ROBOVAST_SEED"] = str(state.seeds[run])


def tick_until_over(execution: Any) -> None:
    """Tick the current scenario at its period until it has a result."""
    while not (execution.shutdown_requested or state.stopped):
        began = time.perf_counter()
        execution.behaviour_tree.tick()
        if execution.live_tree:
            show = importlib.import_module("py_trees.display").unicode_tree
            execution.logger.debug(show(execution.behaviour_tree.root, show_status=True))
        pause = execution.tick_period - (time.perf_counter() - began)
        if pause < 0:
            execution.logger.warning(f"Tick too long: {execution.tick_period - pause:.3f} s")
        elif not execution.shutdown_requested:
            time.sleep(pause)


def shut_down(execution: Any) -> None:
    """Stop what the scenario started; its verdict stands, even when that fails."""
    try:
        execution.behaviour_tree.shutdown()
    except Exception as error:
        execution.logger.error(f"Shutting the scenario down failed: {error}")


def finish_before_reset(execution: Any) -> None:
    """Finish each run before the simulation is reset for the next; what it starts then stays."""
    reset = execution.simulation.reset

    def finish_and_reset(**kwargs: Any) -> None:
        finish_runs(execution)
        reset(**kwargs)
        state.kept = frozenset(descendants())

    execution.simulation.reset = finish_and_reset


def adopt_orphans() -> None:
    """Make all that runs start descendants of this process for good; on Linux only."""
    with contextlib.suppress(ImportError, OSError, AttributeError):
        importlib.import_module("ctypes").CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def has_children() -> bool:
    """Return whether this process has any child, alive or not; takes no search."""
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return False
    return True


def descendants(but: Collection[int] = ()) -> list[int]:
    """Return the processes below this one, but for some children and what is below these."""
    children: dict[int, list[int]] = {}
    for name in os.listdir("/proc") if sys.platform == "linux" and has_children() else ():
        with contextlib.suppress(OSError):  # it has ended
            if name.isdigit():
                with open(f"/proc/{name}/stat", "rb") as file:
                    parent = int(file.read().rpartition(b")")[2].split()[1])
                children.setdefault(parent, []).append(int(name))
    found = [child for child in children.get(os.getpid(), ()) if child not in but]
    for process in found:
        found += children.get(process, ())
    return found


def end_leftovers() -> list[int]:
    """End all that runs have left behind; return the processes that cannot be ended."""
    left: list[int] = []
    for number, seconds in ENDING:
        told: set[int] = set()
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            # Anything found, dead or not, may have started something that was not.
            left = descendants(but=state.kept or ())
            if not left:
                return []
            for process in left:
                if not reaped(process) and process not in told:
                    told.add(process)
                    with contextlib.suppress(OSError):
                        os.kill(process, number)
            time.sleep(0.002)
    return left


def reaped(process: int) -> bool:
    """Return whether a process was a child that has ended; now it is gone."""
    try:
        return os.waitpid(process, os.WNOHANG)[0] == process
    except ChildProcessError:
        return False


def finish_runs(execution: Any) -> None:
    """Run the post commands of the runs that ended, end what is left, and tell that they are over.

    What cannot be ended here ends with the container, and so the pack ends, too.
    """
    for folder in dict.fromkeys(state.ended):
        for command in execution.post_run or []:
            run_post_command(command, folder, execution.logger)
        run = os.path.relpath(folder, execution.output_dir)
        left = end_leftovers()
        if left:
            sys.exit(f"[robovast] error: run {run} has left processes that cannot be ended: {left}")
        state.over.append(run)
        rewrite(os.path.join(os.environ["OUTPUT_DIR"], "finished_runs"), state.over)
    state.ended.clear()


def take_over() -> None:
    """Replace the methods; raise when scenario-execution is not as it is known here."""
    module = importlib.import_module("scenario_execution.scenario_execution_base")
    base = module.ScenarioExecution
    for name, parameters in EXPECTED.items():
        found = list(inspect.signature(getattr(base, name)).parameters)
        if found != parameters:
            raise TypeError(f"{name}({', '.join(found)}), not {name}({', '.join(parameters)})")
    for name in EXPECTED:
        if hasattr(PatchedScenarioExecution, name):
            setattr(original, name, getattr(base, name))
            setattr(base, name, getattr(PatchedScenarioExecution, name))


original = types.SimpleNamespace()
"""The methods that `Pack` replaced."""

state = types.SimpleNamespace(ended=[], over=[], stopped=False, seeds={}, kept=None)
"""Folders of runs that ended and are not over yet; runs that are; whether the pack was asked to
stop; seeds; processes that belong to no run."""


def main() -> None:
    """Run the executor, in this process when it can be taken over."""
    executor, command = sys.argv[1], sys.argv[1:]
    gc.disable()  # until the first run: parsing drops little, and takes a quarter less time so
    try:
        take_over()
    except (ImportError, AttributeError, TypeError) as error:
        sys.stdout.write(
            f"[robovast] warning: this image's scenario-execution is not as expected ({error}); "
            "the verdicts of this job appear only when all of its runs have ended, and of several "
            "runs none gets its ROBOVAST_SEED\n"
        )
        sys.stdout.flush()
        os.execv(executor, command)  # noqa: S606
    adopt_orphans()
    state.seeds.update(read_seeds())
    sys.argv = command
    runpy.run_path(executor, run_name="__main__")


if __name__ == "__main__":
    main()
