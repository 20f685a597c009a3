"""The reason why a run did not pass: the action that failed, and the last error in its own output.

Reasons are short and free of what differs between runs for no reason of their own: paths, and the
arguments of commands. Pure functions, apart from the rules that other packages bring.
"""

from __future__ import annotations

import re
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

from robovast.base.errors import RobovastError
from robovast.base.plugins import load_plugin, plugins_of, raised
from robovast.campaign.job_log import OWN, RUN, own_part
from robovast.campaign.log_lines import BAD, LogMessage, parse_line, without_escapes

RULES = "robovast.failure_reasons"
"""Entry points: functions that find the error in the lines of a run's output."""
LONGEST = 200
"""Most characters of one part of a reason."""

Rule = Callable[[Sequence[str]], str | None]

_LONGEST_LINE = 4000
_EXECUTOR = "scenario_execution"
_STARTED = "Executing scenario '"
"""What the executor logs at the start of each run of a pack."""
_TREE_BEGINS = re.compile(r"(?:^| )(?:-\^-|\{-\}|\[-\]|/_/) ")
"""The root of a behaviour tree, in the line of the executor's log that ends a run that failed."""
_GAVE_UP = f"{OWN}error: "
_OURS = re.compile(r"\[robovast\] |/config/(?:secondary_)?entrypoint\.sh: line \d+:")
_EXECUTORS = re.compile(
    r"(?<=[^\n])(?=\[(?:DEBUG|INFO|WARN|ERROR|FATAL)\] \[\d+\.\d+\] \[scenario_execution\]: )"
)
"""Where a message of the executor begins within a line."""
_CLOCKS_DIFFER = 1.0
"""Most that a start in the log may be later than in test.xml [s]."""

_TRACEBACK = "Traceback (most recent call last)"
_EXCEPTION = re.compile(r"(?:[A-Za-z_]\w*\.)*[A-Z]\w*(?:Error|Exception|Interrupt|Exit)(?:: .*)?")
_AFTER_TRACEBACK = re.compile(r"(?:[A-Za-z_]\w*\.)*[A-Z]\w*(?:: .*)?")
"""An exception's line, whatever its name, after the frames of its traceback."""
_ERROR = re.compile(
    r"(?:what\(\):|panic:|thread '[^']*' panicked at|(?:[^\s:]+:\s?){0,4}(?:fatal )?error:)\s*(.*)",
    re.IGNORECASE,
)
_HARMLESS = frozenset({"debug", "info", "warn"})
_FATAL = re.compile(r"Fatal Python error: (?P<what>.*)")
"""Python's report of its own crash; its frames follow, the innermost first."""
_FRAME = re.compile(r'File "(?P<path>[^"]*)", line (?P<line>\d+) in (?P<function>\S+)')
_OF_PYTHON = re.compile(r"^<|/lib/python\d")
_CURRENT = "Current thread "
_MODULES = "Extension modules: "
_CONSEQUENCE = re.compile(
    r"process has died|failed with (?:code )?-?\d|exit(?:ed)?(?: with)?(?: code| status)? -?\d"
    r"|non-zero exit|terminate called after|core dumped|Traceback \(most recent",
    re.IGNORECASE,
)
"""Such a line says that something failed, the one before it why."""


class _Found(NamedTuple):
    """Texts of a run's output; empty if there are none."""

    error: str
    """The last error or exception."""
    complaint: str
    """The last line on stderr that does not say itself that it is an error, or else what says no
    more than that something failed."""
    last: str


def explain_failure(reason: str, action: str, explained: bool, lines: Sequence[str]) -> str:
    """Complete the reason in a test result with the last error in the run's output.

    Args:
        reason: as in the test result.
        action: the action that failed; empty if unknown.
        explained: whether the reason says more than that the action or its process failed.
        lines: of the run's own output.
    """
    found = _find(lines)
    if explained:
        return _joined(reason, found.error if action else "")
    cause = found.error or found.complaint
    if not cause:
        return _joined(reason, f"its output ends: {found.last}" if found.last else "")
    return f"{action}: {cause}" if action and _BY_SIGNAL not in reason else _joined(reason, cause)


def explain_error(reason: str, lines: Sequence[str]) -> str:
    """Complete the reason of a run without result with the last error in its output, or its end."""
    found = _find(lines)
    if found.error:
        return _joined(reason, found.error)
    return _joined(reason, f"its log ends: {found.last}" if found.last else "")


def error_of_contract(lines: Sequence[str]) -> str:
    """Why the run contract's own scripts gave up; empty where they did not say so."""
    said = [line.removeprefix(_GAVE_UP) for line in lines if line.startswith(_GAVE_UP)]
    return plain(said[-1]) if said else ""


def _joined(*parts: str) -> str:
    return "; ".join(part.removesuffix(".") for part in parts if part)


def lines_of_run(log: bytes, started_at: float | None, run: str = "") -> list[str]:
    """Lines of one run in the end of its job's log, which may have the runs before and after it.

    Args:
        log: the end of the log.
        started_at: start of the run [s since the epoch]; None means the last run. Counts only where
            the log does not name its runs.
        run: `<variant>/<number>`.
    """
    named = bool(run) and RUN.encode() in log
    text = log[own_part(log, run)].decode("utf-8", "replace")
    runs: list[tuple[float, list[str]]] = [(float("-inf"), [])]
    for line in (line[:_LONGEST_LINE] for line in _separated(text).split("\n")):
        if _STARTED in line and (said := parse_line(line)).source == _EXECUTOR:
            runs.append((said.stamp or 0.0, []))
        else:
            runs[-1][1].append(line)
    until = float("inf") if named or started_at is None else started_at + _CLOCKS_DIFFER
    return [lines for start, lines in runs if start <= until][-1]


def _separated(text: str) -> str:
    """A log in which each message of the executor begins a line.

    Its threads write side by side, so that one may begin where another has not ended its line.
    """
    return _EXECUTORS.sub("\n", text)


def _find(lines: Sequence[str]) -> _Found:
    """The error that a rule finds, or else the last one."""
    for name in sorted(plugins_of(RULES)):
        found_reason = _ruled(name, lines)
        if found_reason:
            return _Found(plain(found_reason), "", "")
    error = complaint = consequence = last = ""
    for said, is_exception in _without_dumps(_messages(lines)):
        if _own_level(said) not in _HARMLESS and (is_exception or _is_error(said)):
            text = _error_text(said.text)
            consequence, error = (text, error) if _CONSEQUENCE.search(text) else ("", text)
        elif said.source == _EXECUTOR and said.levels == ["error"]:
            complaint = said.text
        last = said.text
    return _Found(plain(error), plain(complaint or consequence), plain(last))


def _ruled(name: str, lines: Sequence[str]) -> str | None:
    """What a rule finds; a fault of the rule is told in the reason, and changes nothing else."""
    try:
        rule: Rule = load_plugin(name, RULES, ".")
        found_reason = rule(lines)
    except RobovastError as error:
        return str(error)
    except Exception as error:  # whatever others wrote
        return f"the rule `{name}` of {RULES} failed: {raised(error)}"
    return None if found_reason is None else str(found_reason)


def _messages(lines: Sequence[str]) -> Iterator[tuple[LogMessage, bool]]:
    """What the run itself said until its result, and whether it is an exception's line."""
    in_traceback = False
    for line in lines:
        if _OURS.match(line):
            continue
        said = parse_line(line)
        if said.source == _EXECUTOR and _TREE_BEGINS.search(said.text):
            return
        if not said.text:
            continue
        pattern = _AFTER_TRACEBACK if in_traceback else _EXCEPTION
        is_exception = pattern.fullmatch(said.text) is not None
        begins = said.text.startswith(_TRACEBACK)
        in_traceback = begins or (in_traceback and not is_exception)
        yield said, is_exception


def _without_dumps(
    messages: Iterable[tuple[LogMessage, bool]],
) -> Iterator[tuple[LogMessage, bool]]:
    """A crash that Python reports itself becomes one exception: what it was, and where."""
    crash: LogMessage | None = None
    is_current = False
    for said, is_exception in messages:
        if found := _FATAL.match(said.text):
            crash, is_current = said._replace(text=found["what"]), False
        elif crash and said.text.startswith(_CURRENT):
            is_current = True
        elif crash and (frame := _FRAME.match(said.text)):
            if is_current and not _OF_PYTHON.search(frame["path"]):
                where = f"{frame['function']} ({frame['path']}, line {frame['line']})"
                yield crash._replace(text=f"{crash.text} in {where}"), True
                crash = None
        elif not said.text.startswith(_MODULES):
            yield said, is_exception
    if crash:
        yield crash, True


def says_error(line: str) -> bool:
    """Whether a line of a log is an error by itself, not because the executor passed it as one.

    So is the executor's own result: what a program that it stops says afterwards is no cause.
    """
    said = parse_line(line)
    if _FATAL.match(said.text) or (said.source == _EXECUTOR and _TREE_BEGINS.search(said.text)):
        return True
    if _own_level(said) in _HARMLESS:
        return False
    is_exception = said.text.startswith(_TRACEBACK) or _EXCEPTION.fullmatch(said.text) is not None
    return is_exception or _is_error(said)


def _own_level(said: LogMessage) -> str:
    """The level that a message has by itself, not by the executor that passed it."""
    own = said.levels[1:] if said.source == _EXECUTOR else said.levels
    return own[-1] if own else ""


def _is_error(said: LogMessage) -> bool:
    return _own_level(said) in BAD or _ERROR.match(said.text) is not None


def _error_text(text: str) -> str:
    found = _ERROR.match(text)
    return found[1] if found and found[1] else text


_COMMAND = re.compile(
    r"Execut(?:ion of|ing) '\[(?P<words>.*)\]'(?: failed with (?P<code>-?\d{1,9}))?"
)
_WORD = re.compile(r"'([^']*)'|\"([^\"]*)\"")
_MOST_WORDS = 3
"""Words of a command that name its program."""
_PATH = re.compile(
    r"(?<![\w.:/])(?:file://)?~?(?:/[^\s/'\",:;()\[\]{}]+)*/(?P<name>[^\s/'\",:;()\[\]{}]*)"
)
_BY_SIGNAL = "was ended by "
_ENDED = re.compile(r"\bfailed with -?\d+$|^$")
_ROOTS = ("out", "config", "tmp", "home", "usr", "opt", "root", "var", "mnt", "data", "work", "etc")
_IS_FILE = re.compile(r".*\.[A-Za-z]\w{0,5}")


def plain(text: str) -> str:
    """A text in one line, without terminal sequences, paths and arguments of commands; shortened in
    the middle."""
    line = without_escapes(" ".join(text[: 10 * _LONGEST_LINE].split()))
    line = _PATH.sub(_shortened, _COMMAND.sub(_describe_command, line)).strip()
    if len(line) <= LONGEST:
        return line
    return f"{line[: LONGEST // 2]} … {line[-LONGEST // 2 :]}"


def is_command(text: str) -> bool:
    """Whether a text says no more than that a command is executed or failed."""
    return _COMMAND.fullmatch(text.strip()) is not None


def says_only_that_it_failed(reason: str) -> bool:
    """Whether a reason names a program and how it ended, and not why.

    What a program says last may be lost, so that equal failures have such a reason or another one.
    """
    return _ENDED.search(reason) is not None


def _describe_command(found: re.Match[str]) -> str:
    """A command by its program."""
    words: list[str] = []
    for word in (a or b for a, b in _WORD.findall(found["words"][:_LONGEST_LINE])):
        if word.startswith("-") or "…" in word or len(words) == _MOST_WORDS:
            break
        words.append(word.rpartition("/")[2])
    program = " ".join(words)
    return program if found["code"] is None else f"{program} {_ended(int(found['code']))}"


def _ended(code: int) -> str:
    if -code in {item.value for item in signal.Signals}:
        return f"{_BY_SIGNAL}{signal.Signals(-code).name}"
    return f"failed with {code}"


def _shortened(found: re.Match[str]) -> str:
    """A path's name, if it is the path of a file; names of topics have slashes too."""
    parts = [part for part in found[0].removeprefix("file://").split("/") if part]
    is_path = len(parts) > 1 and (parts[0] in _ROOTS or _IS_FILE.fullmatch(parts[-1]))
    return parts[-1] if is_path else found[0]
