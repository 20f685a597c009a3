"""Campaigns whose every run's right verdict and files follow from which run it is.

A `Course` writes such a campaign's document; its runs pass, fail, crash, take more memory than
there is, hang until their timeout, or write odd names. Every execution of a run begins with a line
in a trace outside of the results, and every file that it writes says of which execution it is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

from robovast.campaign.verdict import Verdict


class Kind(StrEnum):
    """What a run does."""

    PASS = "pass"
    FAIL = "fail"
    CRASH = "crash"
    """Its whole process is killed."""
    MEMORY = "memory"
    """It takes more memory than its container may."""
    HANG = "hang"
    """It never ends by itself."""
    ODD = "odd"
    """It passes, and writes files with odd names."""


RIGHT = {
    Kind.PASS: Verdict.PASSED,
    Kind.FAIL: Verdict.FAILED,
    Kind.CRASH: Verdict.ERRORED,
    Kind.MEMORY: Verdict.ERRORED,
    Kind.HANG: Verdict.ERRORED,
    Kind.ODD: Verdict.PASSED,
}

PLAIN: tuple[bytes, ...] = (b"first.txt", b"deep/er/data.csv", b"last.txt")
"""Files of every run."""
ODD: tuple[bytes, ...] = (
    b"with space.txt",
    b" leading and trailing ",
    b"new\nline",
    b"tab\tand\\backslash",
    "Übermaß-日本語.txt".encode(),
    "e\u0301 is not é".encode(),
    b"100%25?x=1&y=#z+~",
    b"-rf",
    b".hidden/.file",
    b"quote'and\"quote",
    b"not-utf-8-\xff.txt",
    b"not-utf-8-\xfe.txt",
    b"job/job",
)
"""Further files of an odd run."""
LINES = 200
"""How often the one line of a file is repeated."""
RECORD = "run.json"
OURS = frozenset({RECORD, "test.xml"})
"""What a run's folder has beside what its script wrote."""
_JOB = ("job/logs/", "job/resource_usage_", "job/sysinfo.yaml")
"""Where the link `job` was followed."""

MIXTURE: tuple[Kind, ...] = (
    *(Kind.PASS, Kind.FAIL, Kind.PASS, Kind.ODD, Kind.CRASH, Kind.PASS, Kind.PASS, Kind.MEMORY),
    *(Kind.PASS, Kind.FAIL, Kind.PASS, Kind.PASS, Kind.HANG, Kind.PASS, Kind.ODD, Kind.PASS),
    Kind.PASS,
)
"""What runs do in turn."""

_SCENARIO = """\
import osc.helpers

scenario course:
    x: int = 1
    here: common
    do serial:
        run_process("bash " + here.get_scenario_file_directory() + "/step.sh"
            + " %s" % x + " " + here.get_output_directory())
"""

_SCRIPT = r"""
# Arguments: the variant's number, and the folder of the run, VARIANT/NUMBER.
set -e
cd "$2"
number=${PWD##*/} variant=${PWD%/*}
run=${variant##*/}/$number
kinds=(@KINDS@)
kind=${kinds[($1 * @STRIDE@ + number) % ${#kinds[@]}]}
read -r execution </proc/sys/kernel/random/uuid

trace() { # EVENT
    echo "@SALT@ $run $execution $1" | @TRACE@
}

keep() { # NUMBER NAME
    local line="@SALT@ $run $1 $execution"
    [[ $2 != */* ]] || mkdir -p -- "${2%/*}"
    for _ in {1..@LINES@}; do printf '%s\n' "$line"; done >"./$2"
}

trace begin
@FIRST@
sleep @PAUSE@
@REST@
if [[ $kind == odd ]]; then
@ODD@
fi
trace "$kind"
case $kind in
fail) exit 1 ;;
crash) kill -9 $PPID ;;
memory) python3 -c 'a = bytearray(@HOG@); input()' || kill -9 $PPID ;;
hang) sleep 100000 ;;
esac
"""
_STRIDE = 5


@dataclass(frozen=True)
class Course:
    """A campaign."""

    salt: str
    """Tells its files from those of every other campaign; letters, digits and `-`."""
    trace: str
    """Command of bash that appends its standard input, a line, to a trace."""
    name: str = "course"
    """Of the document."""
    variants: int = 6
    runs: int = 2
    runs_per_job: int | str = 4
    """How many runs share a pod, or `auto`: as their times suggest."""
    timeout: int = 180
    """When a run that hangs is ended; none else may come near it, on a busy machine neither [s]."""
    pause: float = 1.0
    """Between a run's first file and its others [s]."""
    kinds: Sequence[Kind] = MIXTURE
    memory: str = "300Mi"
    hog: int = 2**30
    """What a run of kind memory takes [byte]."""

    def write(self, folder: Path) -> Path:
        """Write document, scenario and script into an absent folder; returns the .vast file."""
        folder.mkdir(parents=True)
        (folder / "step.sh").write_text(self._script())
        (folder / "scenario.osc").write_text(_SCENARIO)
        path = folder / "course.vast"
        path.write_text(self._document())
        return path

    def _document(self) -> str:
        values = list(range(1, self.variants + 1))
        return (
            "version: 1\n"
            f"metadata: {{name: {self.name}}}\n"
            "configuration:\n"
            "- name: one\n"
            "  variations:\n"
            f"  - ParameterVariationList: {{name: x, values: {values}}}\n"
            "execution:\n"
            "  scenario_file: scenario.osc\n"
            "  run_files: [step.sh]\n"
            f"  runs: {self.runs}\n"
            f"  runs_per_job: {self.runs_per_job}\n"
            f"  timeout: {self.timeout}\n"
            f"  resources: {{memory: {self.memory}, shm_size: 80Mi}}\n"
        )

    def _script(self) -> str:
        names = [f"keep {index} {_quoted(name)}" for index, name in enumerate((*PLAIN, *ODD))]
        inserted = {
            "KINDS": " ".join(self.kinds),
            "STRIDE": str(_STRIDE),
            "TRACE": self.trace,
            "SALT": self.salt,
            "LINES": str(LINES),
            "FIRST": names[0],
            "PAUSE": f"{self.pause:g}",
            "REST": "\n".join(names[1 : len(PLAIN)]),
            "ODD": "\n".join(names[len(PLAIN) :]),
            "HOG": str(self.hog),
        }
        text = _SCRIPT
        for name, value in inserted.items():
            text = text.replace(f"@{name}@", value)
        return text

    def with_runs(self, runs: int) -> Course:
        """The same campaign once its number of runs was raised."""
        return replace(self, runs=runs)

    def kind(self, run: str) -> Kind:
        """What a run does."""
        variant, _, number = run.partition("/")
        x = int(variant.rpartition("-")[2])
        return self.kinds[(x * _STRIDE + int(number)) % len(self.kinds)]

    def truth(self) -> dict[str, Verdict]:
        """The right verdict of every run."""
        names = (f"one-{x}/{n}" for x in range(1, self.variants + 1) for n in range(self.runs))
        return {name: RIGHT[self.kind(name)] for name in names}

    def counts(self) -> Counter[Verdict]:
        """How many runs have which verdict."""
        return Counter(self.truth().values())

    def names(self, run: str) -> tuple[bytes, ...]:
        """The files that a run's script writes, by number."""
        return (*PLAIN, *ODD) if self.kind(run) is Kind.ODD else PLAIN


def _quoted(name: bytes) -> str:
    """A file's name, whatever its bytes, as a word of bash."""
    return "$'" + "".join(f"\\x{byte:02x}" for byte in name) + "'"


@dataclass(frozen=True)
class Seen:
    """What a run's files say."""

    executions: frozenset[str]
    """Of which executions they are."""
    missing: tuple[str, ...]
    """What is not there, or was cut."""
    foreign: tuple[str, ...]
    """What this run did not write, or not so."""

    @property
    def wrong(self) -> tuple[str, ...]:
        """All that is not as it must be, but for more than one execution."""
        return self.missing + self.foreign


def look_at_files(course: Course, run: str, files: Mapping[str, bytes]) -> Seen:
    """Compare a run's files with the truth.

    Args:
        course: its campaign.
        run: which run, `VARIANT/NUMBER`.
        files: content by path below the run's folder; what we store beside them is left alone.
    """
    names = course.names(run)
    executions: set[str] = set()
    complete: Counter[int] = Counter()
    foreign = []
    for path, content in files.items():
        if path in OURS or path.startswith(_JOB) or _is_cut_at_once(course, run, content):
            continue
        parsed = _parse(course, run, content)
        if parsed is None or parsed[0] >= len(names):
            foreign.append(f"{path!r} has another content")
            continue
        index, execution, lines = parsed
        executions.add(execution)
        complete[index] += lines == LINES
        if names[index] in PLAIN and path != names[index].decode():
            foreign.append(f"{path!r} was written under another name")
    missing = [
        f"{name!r} is there {complete[index]} times"
        for index, name in enumerate(names)
        if complete[index] != 1
    ]
    return Seen(frozenset(executions), tuple(missing), tuple(foreign))


def _is_cut_at_once(course: Course, run: str, content: bytes) -> bool:
    """Say whether a file ends before its first line does."""
    begin = f"{course.salt} {run} ".encode()
    return b"\n" not in content and (content.startswith(begin) or begin.startswith(content))


def _parse(course: Course, run: str, content: bytes) -> tuple[int, str, int] | None:
    """Number, execution and whole lines of a file; None when it is not one of this run."""
    line, _, _ = content.partition(b"\n")
    lines = content.count(b"\n")
    match line.decode(errors="replace").split(" "):
        case [course.salt, whose, index, execution] if whose == run and index.isdigit():
            whole = (line + b"\n") * lines
            cut = content[: len(whole)] == whole and line.startswith(content[len(whole) :])
            return (int(index), execution, lines) if cut else None
    return None


@dataclass(frozen=True)
class Trace:
    """A line of the trace: an execution has begun, or does what its kind says."""

    salt: str
    run: str
    execution: str
    event: str


def read_trace(line: str) -> Trace | None:
    """A line of the trace; None when it is none, as when its writer was killed."""
    words = line.split()
    return Trace(*words) if len(words) == 4 else None
