"""Bad .vast files, as a user sees them: the place, what is wrong, what would be right."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

HEAD = "version: 1\n"
TAIL = "execution:\n  scenario_file: drive.osc\n"

CASES = {
    "not YAML": (
        HEAD + "configuration:\n- name: [a\n" + TAIL,
        """\
bad.vast:4:10: not valid YAML: the `[` of line 3 is not closed: here must be `,` or `]`
error: 1 problem in bad.vast
""",
    ),
    "a tab": (
        HEAD + "metadata:\n\ttitle: x\n" + TAIL,
        """\
bad.vast:3:1: not valid YAML: a tab; YAML is indented with spaces alone
error: 1 problem in bad.vast
""",
    ),
    "empty": (
        "",
        """\
bad.vast:1:1: a .vast file is a mapping of sections; this one is empty
error: 1 problem in bad.vast
""",
    ),
    "wrong types deep inside": (
        HEAD + TAIL + "  runs: many\n"
        "  secondary_containers:\n  - nav: {resources: {gpu: a lot}}\n"
        "  resources:\n    memory: [8Gi]\n",
        """\
bad.vast:4:9: execution.runs: must be a whole number, not 'many'
    Number of runs of each configuration, or `min`, `max` and `decide`, which classify it.
bad.vast:6:28: execution.secondary_containers[0].nav.resources.gpu: must be a whole number or a \
list, not 'a lot'
bad.vast:8:14: execution.resources.memory[0]: must be a `name: value` pair, not '8Gi'
error: 3 problems in bad.vast
""",
    ),
    "a seed that is no number": (
        HEAD + TAIL + "  seed: lucky\n",
        """\
bad.vast:4:9: execution.seed: must be a whole number, not 'lucky'
    Seed of the campaign, from which the seeds of all runs are derived (default: random).
error: 1 problem in bad.vast
""",
    ),
    "a seed of more than 31 bits": (
        HEAD + TAIL + "  seed: 2147483648\n",
        """\
bad.vast:4:9: execution.seed: must be at most 2147483647, not 2147483648
    Seed of the campaign, from which the seeds of all runs are derived (default: random).
error: 1 problem in bad.vast
""",
    ),
    "outputs that cannot be compared": (
        HEAD + TAIL + "  compare: [{out.csv: much}, {a.csv: -1}, 3]\n",
        """\
bad.vast:4:13: execution.compare[0]: the tolerance of `out.csv` is not a number
bad.vast:4:30: execution.compare[1]: must be at least 0, not -1
bad.vast:4:43: execution.compare[2]: must be a glob pattern, or one with its tolerance, not 3
error: 3 problems in bad.vast
""",
    ),
    "unknown keys": (
        HEAD + "configuraton: []\n" + TAIL + "  run_per_job: 3\n",
        """\
bad.vast:2:1: configuraton: unknown key `configuraton`
    Did you mean `configuration`?
bad.vast:5:3: execution.run_per_job: unknown key `run_per_job`
    Did you mean `runs_per_job`?
error: 2 problems in bad.vast
""",
    ),
    "no such scenario": (
        HEAD + "execution:\n  scenario_file: drvie.osc\n",
        """\
bad.vast:3:18: execution.scenario_file: there is no scenario file {folder}/drvie.osc
    Files next to the .vast file: drive.osc.
error: 1 problem in bad.vast
""",
    ),
    "no scenario": (
        HEAD + "execution:\n  runs: 2\n",
        """\
bad.vast:3:3: execution: the key `scenario_file` is missing
    OpenSCENARIO 2 file, relative to the .vast file.
error: 1 problem in bad.vast
""",
    ),
    "parameters that the scenario does not have": (
        HEAD + "configuration:\n"
        "- name: a\n  variations:\n"
        "  - ParameterVariationList:\n      name: sped\n      values: [1]\n"
        "- name: b\n  parameters:\n  - colour: red\n" + TAIL,
        """\
bad.vast:6:13: configuration[0].variations[0].ParameterVariationList.name: the scenario `drive` \
has no parameter `sped`
    Did you mean `speed`?
bad.vast:10:5: configuration[1].parameters[0].colour: the scenario `drive` has no parameter \
`colour`
    Known here: distance, goal, speed.
error: 2 problems in bad.vast
""",
    ),
    "wrong parameters of a variation": (
        HEAD + "configuration:\n- name: a\n  variations:\n"
        "  - ParameterVariationList: {name: speed, value: [1]}\n"
        "  - ParamVariationList: {name: speed, values: [1]}\n" + TAIL,
        """\
bad.vast:5:29: configuration[0].variations[0].ParameterVariationList: the key `values` is missing
    One value for each configuration; with several parameters, lists as long as `name`.
bad.vast:5:43: configuration[0].variations[0].ParameterVariationList.value: unknown key `value`
    Did you mean `values`?
bad.vast:6:5: configuration[0].variations[1]: there is no plugin `ParamVariationList` in \
robovast.variation_types. Did you mean `ParameterVariationList`? A plugin in a file is written \
`<path>.py:<name>`.
error: 3 problems in bad.vast
""",
    ),
    "names": (
        HEAD
        + "configuration:\n- name: a\n- name: a\n- name: a/b\n- name: ..\n- name: campaign.db\n"
        + TAIL,
        """\
bad.vast:4:9: configuration[1].name: the name `a` occurs twice; the first is configuration[0]
    Results are kept by name: give each configuration its own.
bad.vast:5:9: configuration[2].name: `a/b` cannot name a folder: use letters, digits, `-`, `_` \
and `.`, beginning with a letter or digit, at most 100
    Unique name; the names of the results folders start with this name.
bad.vast:6:9: configuration[3].name: `..` cannot name a folder: use letters, digits, `-`, `_` \
and `.`, beginning with a letter or digit, at most 100
    Unique name; the names of the results folders start with this name.
bad.vast:7:9: configuration[4].name: `campaign.db` is a file of the campaign itself: choose \
another name
    Unique name; the names of the results folders start with this name.
error: 4 problems in bad.vast
""",
    ),
    "an alias of what it is part of": (
        HEAD + "metadata: &all\n  again: *all\n" + TAIL,
        """\
bad.vast:2:11: not valid YAML: an alias (`*name`) refers to a value that contains the alias
error: 1 problem in bad.vast
""",
    ),
    "a key twice": (
        HEAD + TAIL + "version: 1\n",
        """\
bad.vast:4:1: the key `version` occurs twice in one mapping, first in line 1; YAML would keep \
only the last
error: 1 problem in bad.vast
""",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_bad_file_is_explained(vast, folder: Path, case: str) -> None:
    text, expected = CASES[case]
    (folder / "bad.vast").write_text(text)
    outcome = vast("-V", "bad.vast", "config", "list")
    assert outcome.err == expected.replace("{folder}", str(folder))
    assert (outcome.code, outcome.out) == (2, "")


def test_run_files_that_are_not_there_are_a_warning(vast, folder: Path) -> None:
    (folder / "bad.vast").write_text(HEAD + TAIL + "  run_files:\n  - files/*.py\n")
    outcome = vast("-V", "bad.vast", "config", "check")
    assert outcome.code == 0
    assert outcome.out == "bad.vast: valid, 1 configuration, 1 warning\n"
    assert outcome.err == (
        f"warning: bad.vast:5:5: execution.run_files[0]: `files/*.py` matches no file in {folder}\n"
        "    Patterns are relative to the .vast file and stay in its folder.\n"
        "differs from the original RoboVAST: bad.vast:1:1: one configuration, `config1`, runs; "
        "RoboVAST 1.x runs nothing\n"
        "differs from the original RoboVAST: bad.vast:5:5: execution.run_files[0]: `files/*.py` "
        "causes a warning; RoboVAST 1.x does not warn\n"
    )


def test_a_glob_that_matches_nothing_names_what_there_is(vast, sweep: Path) -> None:
    outcome = vast("exec", "local", "run", "-c", "swep*", "out", "--runtime", "process")
    assert outcome.code == 2
    assert outcome.err == (
        "error: no configuration matches `swep*` (7 available)\n"
        "hint: use for example sweep, or run `vast config list` to see all\n"
    )
    assert not (sweep.parent / "out").exists()


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ([], "no .vast file found in this folder"),
        (["a", "b"], "several .vast files found in this folder (a.vast, b.vast)"),
    ],
)
def test_without_a_file_the_remedy_is_told(vast, folder, files: list[str], message: str) -> None:
    for name in files:
        (folder / f"{name}.vast").write_text(HEAD + TAIL)
    outcome = vast("config", "list")
    assert outcome.code == 2
    assert outcome.err == (
        f"error: {message}\n"
        "hint: pass one with `vast -V FILE …`, or create a project with `vast init FILE`\n"
    )


FOREIGN = ("Value error", "Input should", "Errno", "Traceback", "codec", "<list[", "{OUT}")
RUN = ["exec", "local", "run", "--runtime", "process"]
BAD = [
    (["config", "generate", "file"], 5, "file is a file, and results go into a folder"),
    (
        ["config", "generate", "a" * 300],
        5,
        "cannot be used (a name is too long), and results go into",
    ),
    (["config", "generate", "file/x"], 5, "file is a file, and results go into a folder"),
    (["exec", "local", "prepare-run", "file"], 5, "/file is a file, and results go into"),
    (
        ["exec", "local", "run", "drive.vast"],
        2,
        "`drive.vast` is a .vast file, but OUT is the results folder",
    ),
    (["exec", "local", "run", "file", "--runtime", "process"], 5, "file is a file, and results"),
    (
        ["exec", "local", "run", "gone.vast"],
        2,
        "`gone.vast` does not exist\nhint: pass a .vast file with",
    ),
    (
        [*RUN, "dangling/x"],
        5,
        "dangling is a link to `nowhere`, which leads nowhere, and results go",
    ),
    ([*RUN, "loop"], 5, "loop is a link to `loop`, which leads nowhere, and results go into a"),
    (
        [*RUN, "/dev/null/x"],
        5,
        "/dev/null is a device or a pipe, and results go into a folder\nhint: choose",
    ),
    (
        [*RUN, "/proc/x"],
        5,
        "/proc/x: results cannot be written there: no folder can be created in it\nhint: choose",
    ),
    ([*RUN, "a" * 300], 5, "cannot be used (a name is too long), and results go into"),
    ([*RUN, "b\udcff"], 5, "the path is not text in UTF-8\nhint: choose"),
    (
        [*RUN, "fixed"],
        2,
        "`fixed` is a configuration, but OUT is the results folder\nhint: use `--config",
    ),
    ([*RUN, "sweep"], 2, "`sweep` is the name of 6 configurations, but OUT is the results"),
    ([*RUN, "sweep-*"], 2, "`sweep-*` is the name of 6 configurations, but OUT is the results"),
    (
        [*RUN, "sweep-9-9"],
        2,
        "no configuration matches `sweep-9-9` (7 available)\nhint: use for example sweep",
    ),
    ([*RUN, "x*"], 2, "no configuration matches `x*` (7 available)\nhint: use for example sweep"),
    ([*RUN, "--resume", "file"], 2, "/file is not a campaign's folder: "),
    ([*RUN, "--resume", "loop"], 2, "loop is a link to `loop`, which leads nowhere"),
    ([*RUN, "--resume", "b\udcff"], 5, "the path is not text in UTF-8\nhint: choose"),
    (["-V", ".", "config", "check"], 2, ".: cannot be read: it is a folder"),
    (["-V", "dangling", "config", "check"], 2, "dangling: is a link to `nowhere`, which does not"),
    (
        ["-V", "loop", "config", "check"],
        2,
        "loop: cannot be read: a link in its path leads back to",
    ),
    (["-V", "file/x", "config", "check"], 2, "cannot be read: a part of its path is not a folder"),
    (
        ["-V", "/dev/zero", "config", "check"],
        2,
        "/dev/zero: cannot be read: is not a regular file",
    ),
    (["exec", "cluster", "prepare-run", "file"], 5, "file is a file, and results go into"),
    (["results", "postprocess", "-r", "file"], 2, "file is a file\nhint: name a results folder"),
    (
        ["import-results", "file"],
        2,
        "(it does not begin like a tar or zip file)\nhint: download it again",
    ),
    (["exec", "cluster", "monitor", "--once"], 3, "no kubeconfig has a current context"),
    (
        ["exec", "cluster", "run", "--image", "a", "-x", "lab"],
        3,
        "the context `lab` does not exist in your kubeconfig",
    ),
    (["exec", "cluster", "runs", "-n", "a/../b"], 2, "`a/../b` is not a valid namespace name"),
    (["exec", "cluster", "retry", "-n", "a?b=1"], 2, "`a?b=1` is not a valid namespace name"),
    (["exec", "cluster", "run", "--dry-run", "--queue", "Q_Q"], 2, "queue_name: must match"),
    (
        ["config", "export-configs", "none"],
        2,
        "(7 available)\nhint: use for example sweep, fixed, sweep-1-1",
    ),
]


@pytest.mark.parametrize(("arguments", "code", "message"), BAD)
def test_no_library_speaks_to_the_user(
    vast,
    sweep: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    code: int,
    message: str,
) -> None:
    (sweep.parent / "file").write_text("x")
    (sweep.parent / "dangling").symlink_to("nowhere")
    (sweep.parent / "loop").symlink_to("loop")
    monkeypatch.setenv("KUBECONFIG", str(sweep.parent / "none"))
    outcome = vast(*arguments)
    assert outcome.code == code, outcome
    assert message in outcome.err
    assert not [words for words in FOREIGN if words in outcome.err]


def test_amounts_are_checked_before_a_campaign_begins(vast, folder: Path) -> None:
    resources = "  resources: {cpu: [{lab: many}], memory: 8Gx, shm_size: much}\n"
    disk = "  kubernetes: {ephemeral_storage: 1GB}\n"
    (folder / "bad.vast").write_text(HEAD + TAIL + resources + disk)
    outcome = vast("-V", "bad.vast", "config", "check")
    assert outcome.code == 2
    for said in (
        "resources.cpu: `many` is not a number of CPUs. Write `2`, `0.5` or `500m`.",
        "resources.memory: `8Gx` is not a valid quantity of memory. Write `8Gi` or `4096Mi`.",
        "resources.shm_size: `much` is not a valid quantity of memory. Write `8Gi` or `4096Mi`.",
        "kubernetes.ephemeral_storage: `1GB` is not a valid quantity of disk. Write `8Gi` or "
        "`4096Mi`.",
    ):
        assert re.search(rf"^bad\.vast:\d+:\d+: execution\.{re.escape(said)}$", outcome.err, re.M)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("4", "`4` is 4 bytes; no run can do with less than 1Mi. Write for example `4Gi`"),
        (
            "4096",
            "`4096` is 4,096 bytes; no run can do with less than 1Mi. Write for example `4096Mi`",
        ),
        ("0.5", "`0.5` is 0.5 bytes; no run can do with less than 1Mi. Write for example `0.5Gi`"),
        ("4k", "`4k` is 4,000 bytes; no run can do with less than 1Mi. Write `8Gi` or `4096Mi`"),
    ],
)
def test_an_amount_without_its_unit_is_refused_wherever_runs_begin(
    vast, folder: Path, given: str, said: str
) -> None:
    amounts = f"  resources: {{memory: {given}}}\n  kubernetes: {{ephemeral_storage: {given}}}\n"
    (folder / "a.vast").write_text(HEAD + TAIL + amounts)
    message, _, remedy = said.partition(". ")
    hint = remedy[0].lower() + remedy[1:]
    checked = vast("-V", "a.vast", "config", "check")
    assert checked.code == 2
    for key in ("resources.memory", "kubernetes.ephemeral_storage"):
        assert f": execution.{key}: {said}" in checked.err
    for begin in (["local", "run", "out"], ["local", "prepare-run", "out"]):
        outcome = vast("-V", "a.vast", "exec", *begin)
        assert outcome.code == 2
        assert f"a.vast: execution.resources.memory: {message}\nhint: {hint}\n" in outcome.err
        assert not (folder / "out").exists()
    outcome = vast("-V", "a.vast", "exec", "cluster", "run", "--dry-run")
    assert outcome.code == 2
    assert f"a.vast: resources.memory of execution: {message}\nhint: {hint}\n" in outcome.err


def test_a_number_of_gpus_for_a_context_is_checked_wherever_runs_begin(vast, folder: Path) -> None:
    gpus = "  resources: {gpu: [{local: many}, {lab: -1}]}\n"
    (folder / "a.vast").write_text(HEAD + TAIL + gpus)
    checked = vast("-V", "a.vast", "config", "check")
    assert checked.code == 2
    for given in ("many", "-1"):
        told = f"execution.resources.gpu: `{given}` is not a number of GPUs"
        assert re.search(rf"^a\.vast:\d+:\d+: {re.escape(told)}", checked.err, re.M)
    for begin in (["local", "run", "out"], ["local", "prepare-run", "out"]):
        outcome = vast("-V", "a.vast", "exec", *begin)
        assert outcome.code == 2
        assert "resources.gpu: `many` is not a number of GPUs" in outcome.err
        assert not (folder / "out").exists()
    outcome = vast("-V", "a.vast", "exec", "cluster", "run", "--dry-run", "--context", "lab")
    assert outcome.code == 2
    assert "resources.gpu of execution: `-1` is not a number of GPUs" in outcome.err


def test_gpus_that_are_named_and_not_asked_for_are_refused_wherever_runs_begin(
    vast, folder: Path
) -> None:
    gpus = HEAD + TAIL + "  kubernetes: {gpu_resource: amd.com/gpu}\n"
    (folder / "a.vast").write_text(gpus)
    for begin in (
        ["config", "check"],
        ["exec", "local", "run", "out"],
        ["exec", "local", "prepare-run", "out"],
        ["exec", "cluster", "run", "--dry-run"],
    ):
        outcome = vast("-V", "a.vast", *begin)
        assert outcome.code == 2
        told = r"^(error: )?a\.vast:\d+:\d+: execution\.kubernetes\.gpu_resource: no container"
        assert re.search(told, outcome.err, re.M)
        assert "Add `gpu` to `execution.resources`" in outcome.err
        assert not (folder / "out").exists()
    (folder / "a.vast").write_text(
        gpus + "  secondary_containers: [{sim: {resources: {gpu: 0}}}]\n"
    )
    assert vast("-V", "a.vast", "config", "check").code == 0


@pytest.mark.parametrize(("other", "code"), [("x: 1", 2), ("speed: 1", 3)])
def test_a_package_that_a_plugin_lacks_is_no_fault_of_the_file(
    vast, folder: Path, other: str, code: int
) -> None:
    (folder / "plug.py").write_text("import nosuchpackage")
    configuration = (
        f"- {{name: a, variations: [plug.py:A]}}\n- {{name: b, parameters: [{other}]}}\n"
    )
    (folder / "a.vast").write_text(HEAD + "configuration:\n" + configuration + TAIL)
    outcome = vast("-V", "a.vast", "config", "check")
    assert outcome.code == code
    assert "plug.py cannot be imported: the package `nosuchpackage` is not" in outcome.err


def test_files_that_cannot_be_read(vast, folder: Path) -> None:
    (folder / "latin.vast").write_bytes(b"version: 1\nmetadata: {title: caf\xe9}\n")
    assert vast("-V", "latin.vast", "config", "list").err == (
        "error: latin.vast: not a text file in UTF-8 (byte 32)\n"
        "hint: check that it is the right file\n"
    )
    assert vast("-V", "none.vast", "config", "list").err == (
        "error: none.vast: there is no such file\nhint: check the path\n"
    )
    assert vast("-V", folder, "config", "list").code == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["confg"], "no such command 'confg'\nhint: did you mean 'config'?\n"),
        (["summary"], "no such command 'summary'\nhint: did you mean `vast results summary`?\n"),
        (["run"], "hint: did you mean `vast exec cluster run`, `vast exec local run`?"),
        (
            ["results", "summary", "a", "b"],
            "hint: if a `*` on the command line matches several files",
        ),
        (["config", "check", "a.vast"], "before the command: `vast -V FILE …`"),
        (["config", "lst"], "no such command 'lst'\nhint: did you mean 'list'?\n"),
        (
            ["config", "list", "-o", "xml"],
            ": must be one of table, name, json, yaml, not 'xml'\nhint: run `vast config list",
        ),
        (["-l", "wrning", "config", "list"], "not 'wrning'\nhint: did you mean 'warning'?"),
        (["exec", "local", "run", "--runtime", "podmn"], "hint: did you mean 'podman'?\n"),
        (
            ["exec", "local", "run", "--jobs", "0"],
            "'-j' / '--jobs': must be at least 1, not '0'\nhint: run `vast exec local run --help`",
        ),
        (["exec", "local", "run", "--jobs", "x"], ": must be a whole number, not 'x'\n"),
        (["evaluation", "gui", "-p", "99999"], ": must be at most 65535, not '99999'\n"),
        (
            ["config", "list", "-V"],
            "error: no such option: -V\nhint: run `vast config list --help`\n",
        ),
        (["exec", "local", "run", "--job"], "no such option: --job\nhint: did you mean --jobs?\n"),
        (["config", "generate"], "error: missing argument 'OUT'\nhint: run `vast config generate"),
        (["config", "generate"], "Usage: vast config generate [OPTIONS] OUT\n"),
        (["config", "export-configs"], "Usage: vast config export-configs [OPTIONS] PATTERN...\n"),
        (["exec", "cluster", "stop", "-x", "a", "--context", "b"], "'--context': is given twice"),
        (["results", "summary", "--context", "a", "--context=a"], "run the command again for each"),
        (
            ["exec", "local", "run", "a", "-o", "b"],
            "OUT (a) and --output (b) differ\nhint: use one of them\n",
        ),
        (
            ["exec", "local", "run", "a", "--resume", "b"],
            "`--resume` stores results in the campaign",
        ),
    ],
)
def test_usage_errors(vast, sweep: Path, arguments: list[str], message: str) -> None:
    outcome = vast(*arguments)
    assert outcome.code == 2
    assert message in outcome.err
    assert outcome.err.startswith("Usage: vast ")
