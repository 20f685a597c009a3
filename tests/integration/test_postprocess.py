"""Postprocessing of finished campaigns, with plugins in their own processes."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from support.campaigns.finished import NAME, add_run, as_of_another_tool, finished_campaign
from support.campaigns.local import make_campaign, run

from robovast.analysis.postprocessing.events import Failure, Options, PostprocessingSummary
from robovast.analysis.postprocessing.session import postprocess
from robovast.analysis.tables.query import ask

PLUGINS = '''
from pathlib import Path

def _count(results_dir, name):
    with (Path(results_dir) / "_execution" / name).open("a") as file:
        file.write("x")

def metrics(results_dir, config_dir, factor=2, provenance_file=None):
    """The guide's signature."""
    _count(results_dir, "metrics.calls")
    for path in sorted(Path(results_dir).glob("*/*/out.csv")):
        value = int(path.read_text().split()[1])
        (path.parent / "metrics.csv").write_text(f"score\\n{value * factor}\\n")
    return True, "done"

def each(results_dir, config_dir):
    run = Path(results_dir)
    _count(run.parent.parent, "each.calls")
    (run / "each.csv").write_text((run / "out.csv").read_text())
    return True, "", [{"output": "each.csv", "sources": ["out.csv"], "plugin": "each"}]

each.per_run = True

class Configured:
    def __init__(self, text, number=1):
        self.text = text

    def __call__(self, results_dir, config_dir):
        (Path(results_dir) / "text.txt").write_text(self.text)
        return True, ""

class Called:
    def __call__(self, results_dir, config_dir, text):
        (Path(results_dir) / "called.txt").write_text(text)
        return True, ""
'''
BOTH = "  - tools/plugins.py:each\n  - tools/plugins.py:metrics: {factor: 3}\n"


class Watcher:
    """Remembers what it was told."""

    def __init__(self) -> None:
        self.messages: list[str] = []
        self.failures: list[Failure] = []

    def campaign_started(self, campaign: Path, runs: int) -> None: ...
    def step_started(self, title: str, total: int) -> None: ...
    def step_advanced(self) -> None: ...
    def campaign_finished(self, summary: PostprocessingSummary) -> None: ...

    def failed(self, failure: Failure) -> None:
        self.failures.append(failure)

    def message(self, text: str) -> None:
        self.messages.append(text)


def work(campaign: Path, **options: object) -> PostprocessingSummary:
    chosen = {"skip_metadata": True, "skip_tables": True, **options}
    summaries = postprocess(campaign.parent, Options(**chosen), Watcher())  # type: ignore[arg-type]
    return next(s for s in summaries if s.campaign == campaign.absolute())


def failures(campaign: Path, **options: object) -> list[str]:
    return [f"{f.where}: {f.message}" for f in work(campaign, **options).failures]


def calls(campaign: Path, name: str) -> int:
    path = campaign / "_execution" / f"{name}.calls"
    return len(path.read_text()) if path.exists() else 0


def entries(folder: Path) -> dict[str, dict[str, object]]:
    data = yaml.safe_load((folder / "postprocessing.yaml").read_text())
    return {entry["output"]: entry for entry in data["entries"]}


def test_nothing_is_worked_twice_and_only_what_changed_again(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 4, BOTH, PLUGINS)
    assert work(campaign).worked == {"c-1/0", "c-1/1", "c-2/0", "c-2/1"}
    assert (campaign / "c-2/1/metrics.csv").read_text() == "score\n9\n"
    assert (calls(campaign, "each"), calls(campaign, "metrics")) == (4, 1)

    assert work(campaign).worked == set()
    for path in campaign.rglob("*.csv"):
        os.utime(path)  # touched, but the same
    assert work(campaign).worked == set()

    (campaign / "c-1/1/out.csv").write_text("v\n70\n")
    work(campaign)
    assert (calls(campaign, "each"), calls(campaign, "metrics")) == (5, 2)
    assert (campaign / "c-1/1/each.csv").read_text() == "v\n70\n"

    (campaign / "c-2/0/each.csv").unlink()
    add_run(campaign, "c-2", 2, 9)
    work(campaign)
    assert (calls(campaign, "each"), calls(campaign, "metrics")) == (7, 3)
    work(campaign, force=True)
    assert (calls(campaign, "each"), calls(campaign, "metrics")) == (12, 4)


def test_what_a_command_on_the_whole_campaign_made_is_made_again_when_it_is_removed(
    tmp_path: Path,
) -> None:
    campaign = finished_campaign(tmp_path, 2, BOTH, PLUGINS)
    work(campaign)
    (campaign / "c-1/1/metrics.csv").unlink()
    work(campaign)
    assert (campaign / "c-1/1/metrics.csv").exists()
    assert calls(campaign, "metrics") == 2
    assert work(campaign).worked == set()


def test_parameters_and_code_are_part_of_the_cache(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1, BOTH, PLUGINS)
    work(campaign)
    document = campaign / "_config/c.vast"
    document.write_text(document.read_text().replace("factor: 3", "factor: 5"))
    work(campaign)
    assert (calls(campaign, "each"), calls(campaign, "metrics")) == (1, 2)
    with (campaign / "_config/tools/plugins.py").open("a") as file:
        file.write("# new\n")
    work(campaign)
    assert (calls(campaign, "each"), calls(campaign, "metrics")) == (2, 3)


def test_metadata_follow_the_document_without_work_on_runs(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1, BOTH, PLUGINS)
    work(campaign, skip_metadata=False)
    with (campaign / "_config/c.vast").open("a") as file:
        file.write("metadata: {title: A new title}\n")
    assert work(campaign, skip_metadata=False).worked == set()
    data = yaml.safe_load((campaign / "metadata.yaml").read_text())
    assert data["metadata"]["title"] == "A new title"


def test_a_copied_campaign_is_not_worked_again(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path / "a", 2, BOTH, PLUGINS)
    work(campaign)
    shutil.copytree(tmp_path / "a", tmp_path / "b", symlinks=True)
    assert work(tmp_path / "b" / NAME).worked == set()


def test_files_are_recorded_with_their_sources(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1, BOTH, PLUGINS)
    work(campaign)
    found = entries(campaign / "c-1/0")
    assert found["c-1/0/each.csv"]["sources"] == ["c-1/0/out.csv"]
    made = found["c-1/0/metrics.csv"]
    assert (made["plugin"], made["params"]) == ("tools/plugins.py:metrics", {"factor": 3})
    whole = yaml.safe_load((campaign / "_transient/postprocessing.yaml").read_text())
    assert whole["started_at"] <= whole["ended_at"]


def test_classes_take_parameters_either_way(tmp_path: Path) -> None:
    section = (
        "  - tools/plugins.py:Configured: {text: one}\n  - tools/plugins.py:Called: {text: two}\n"
    )
    campaign = finished_campaign(tmp_path, 1, section, PLUGINS)
    assert failures(campaign) == []
    assert (campaign / "text.txt").read_text() + (campaign / "called.txt").read_text() == "onetwo"


BAD = """
import os, shutil, sys, tempfile, time
from pathlib import Path

def raises(results_dir, config_dir):
    return 1 / 0

def returns_nothing(results_dir, config_dir):
    pass

def refuses(results_dir, config_dir):
    return False, "no odometry"

def hangs(results_dir, config_dir):
    time.sleep(600)

def exits(results_dir, config_dir):
    sys.exit(3)

def dies(results_dir, config_dir):
    os.abort()

def ends(results_dir, config_dir):
    os._exit(4)

def writes_outside(results_dir, config_dir):
    (Path(results_dir).parent / "other" / "x").write_text("")
    return True, ""

def hides_it(results_dir, config_dir):
    try:
        os.remove(Path(results_dir).parent / "other" / "run.json")
    except OSError:
        pass
    return True, ""

def claims_outside(results_dir, config_dir):
    return True, "", [{"output": "../x"}]

def leaves_no_json(results_dir, config_dir, provenance_file):
    Path(provenance_file).write_text("[")
    return True, ""

def takes_b(results_dir, config_dir, b):
    return True, ""

no_function = 5

def good(results_dir, config_dir):
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "below").mkdir()
        (Path(folder) / "below" / "x").write_text("")
        shutil.copy(Path(folder) / "below" / "x", Path(results_dir) / "good.txt")
    (Path(results_dir) / "moved").mkdir()
    os.rename(Path(results_dir) / "moved", Path(results_dir) / "again")
    shutil.rmtree(Path(results_dir) / "again")
    return True, ""
"""
BAD_MESSAGES = {
    "raises": "raised ZeroDivisionError: division by zero (",
    "returns_nothing": "returned `None`, not `(success, message)`",
    "refuses": "no odometry",
    "hangs": "did not end within 1 s and was stopped; `--time-limit` sets",
    "exits": "called `sys.exit(3)` instead of returning",
    "dies": "crashed (SIGABRT)",
    "ends": "ended its process with exit code 4 instead of returning",
    "writes_outside": "other/x: it is outside of the campaign",
    "hides_it": "must not write",
    "claims_outside": "lists ../x, which is outside of the campaign",
    "leaves_no_json": "its provenance file is not JSON",
    "takes_b": "missing a required argument: 'b'. Use its parameters: `b`",
    "no_function": "is a int, which cannot be called",
    "missing": "has no `missing`. Use one of",
}


def test_bad_plugins_have_one_clear_message_each_and_stop_nothing_else(tmp_path: Path) -> None:
    names = [*BAD_MESSAGES, "good"]
    section = "".join(f"  - tools/plugins.py:{name}\n" for name in names)
    campaign = finished_campaign(tmp_path, 1, section, BAD)
    other = tmp_path / "other"
    other.mkdir()
    (other / "run.json").write_text("{}")
    found = work(campaign, time_limit=1.0).failures
    messages = {failure.command: failure.message for failure in found}
    assert messages.keys() == BAD_MESSAGES.keys()
    for name, part in BAD_MESSAGES.items():
        assert part in messages[name], messages[name]
    assert (campaign / "good.txt").exists()
    assert [path.name for path in other.iterdir()] == ["run.json"]
    assert len(work(campaign, time_limit=1.0, skip=("hangs", "good")).failures) == 13


def test_unknown_plugins_are_named_with_a_suggestion(tmp_path: Path) -> None:
    section = "  - rosbags_tf_to_cvs\n  - tools/plugins.py:each\n"
    campaign = finished_campaign(tmp_path, 1, section, PLUGINS)
    assert "Did you mean `rosbags_tf_to_csv`?" in failures(campaign)[0]
    assert (campaign / "c-1/0/each.csv").exists()


KEYWORDS = """
import json
from pathlib import Path
from robovast.results_processing.postprocessing_plugins import BasePostprocessingPlugin

class Keywords(BasePostprocessingPlugin):
    def __call__(self, results_dir, config_dir, **kwargs):
        del kwargs["provenance_file"]
        (Path(results_dir) / "given.json").write_text(json.dumps(kwargs))
        return True, ""
"""


def test_a_plugin_is_given_what_is_known_and_was_asked_for(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1, "  - tools/plugins.py:Keywords: {a: 1}\n", KEYWORDS)
    assert failures(campaign) == []
    assert json.loads((campaign / "given.json").read_text()) == {"a": 1}
    (campaign / "_execution/execution.yaml").write_text("image: robots/hall:1\n")
    assert failures(campaign, force=True, debug=True) == []
    given = {"a": 1, "execution_image": "robots/hall:1", "debug": True, "force": True}
    assert json.loads((campaign / "given.json").read_text()) == given


FAILS_FOR_ONE = """
from pathlib import Path

def each(results_dir, config_dir):
    if results_dir.endswith("c-1/1"):
        raise RuntimeError("odd")
    (Path(results_dir) / "each.csv").write_text("a\\n1\\n")
    return True, ""

each.per_run = True
"""


def test_one_failing_run_is_named_and_only_it_is_tried_again(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 4, "  - tools/plugins.py:each\n", FAILS_FOR_ONE)
    summary = work(campaign)
    assert [f.where for f in summary.failures] == ["c-1/1"]
    assert len(list(campaign.glob("*/*/each.csv"))) == 3
    assert work(campaign).worked == {"c-1/1"}


def test_one_broken_campaign_does_not_stop_the_others(tmp_path: Path) -> None:
    broken = finished_campaign(tmp_path, 1, "  - [x]\n", name="a b-2026-01-01-000000")
    good = finished_campaign(tmp_path, 1, BOTH, PLUGINS)
    assert "c.vast:6:5" in work(broken).failures[0].message
    assert work(good).failures == []
    assert (good / "c-1/0/metrics.csv").exists()


def test_an_override_is_used_for_every_campaign(tmp_path: Path) -> None:
    results = tmp_path / "results"
    campaigns = [finished_campaign(results, 1, name=f"{n}-2026-01-01-000000") for n in "ab"]
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/m.py").write_text(PLUGINS)
    override = tmp_path / "mine/new.vast"
    override.write_text("results_processing: {postprocessing: ['m.py:metrics']}")
    postprocess(results, Options(override=override, skip_metadata=True), Watcher())
    assert all((campaign / "c-1/0/metrics.csv").exists() for campaign in campaigns)


def test_results_of_another_tool(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 2, BOTH, PLUGINS)
    as_of_another_tool(campaign)
    assert failures(campaign) == []
    assert (campaign / "c-1/1/metrics.csv").exists()


def test_a_campaign_without_a_document_has_no_commands(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1)
    (campaign / "_config/c.vast").unlink()
    watcher = Watcher()
    (summary,) = postprocess(tmp_path, Options(skip_metadata=True), watcher)
    assert (summary.document, summary.commands, watcher.failures) == (None, 0, [])


SCRIPT = """\
#!/bin/bash
test "$1" = --provenance-file && test "$#" = 4 && test "$4" = "$PWD" || exit 9
echo "$3" > "c-1/0/script.txt"
printf '{"entries": [{"output": "c-1/0/script.txt", "sources": ["c-1/0/out.csv"]}]}' > "$2"
test "$3" = good || { echo "cannot do $3 for $CONFIG_DIR with $ROBOVAST_IMAGE"; exit 7; }
"""


def test_the_command_plugin_executes_a_script(tmp_path: Path) -> None:
    section = "  - command: {script: tools/s.sh, args: [good]}\n"
    campaign = finished_campaign(tmp_path, 1, section)
    script = campaign / "_config/tools/s.sh"
    script.write_text("true\n")
    assert "s.sh is not executable: chmod +x" in failures(campaign)[0]
    script.write_text(SCRIPT)  # as files come from S3, without their mode
    assert failures(campaign) == []
    entry = entries(campaign / "c-1/0")["c-1/0/script.txt"]
    assert (entry["plugin"], entry["sources"]) == ("command", ["c-1/0/out.csv"])
    document = campaign / "_config/c.vast"
    document.write_text(document.read_text().replace("good", "bad"))
    (campaign / "_execution/execution.yaml").write_text("image: robots/hall:1\n")
    said = f"cannot do bad for {campaign / '_config'} with robots/hall:1"
    assert f"`tools/s.sh` ended with exit code 7: {said}" in failures(campaign)[0]


GUIDE = """
from typing import Tuple, Optional, List

def my_postprocessing_command(
    results_dir: str,
    config_dir: str,
    custom_param: Optional[str] = None,
    provenance_file: Optional[str] = None,
) -> Tuple[bool, str]:
    import subprocess
    import os
    script = os.path.join(config_dir, "tools/script.sh")
    cmd = [script, results_dir]
    if custom_param:
        cmd.extend(["--param", custom_param])
    result = subprocess.run(cmd, capture_output=True, text=True)
    if result.returncode != 0:
        return False, f"Failed: {result.stderr}"
    return True, "Success"
"""


def test_the_guides_plugin_works_as_it_stands(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1, plugins=GUIDE)
    name = "tools/plugins.py:my_postprocessing_command"
    with (campaign / "_config/c.vast").open("a") as file:
        file.write(f"analysis:\n  postprocessing:\n  - {name}:\n      custom_param: value\n")
    script = campaign / "_config/tools/script.sh"
    script.write_text('#!/bin/sh\necho "$2 $3" > "$1/c-1/0/made.txt"\n')
    script.chmod(0o755)
    assert failures(campaign) == []
    assert (campaign / "c-1/0/made.txt").read_text() == "--param value\n"
    script.write_text("#!/bin/sh\necho no space >&2; exit 1\n")
    assert failures(campaign) == [": Failed: no space"]  # all of `_config` is part of the cache


def test_compress_packs_the_campaign_beside_it(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1, "  - compress\n")
    assert failures(campaign) == []
    archive = tmp_path / f"{NAME}.tar.gz"
    names = subprocess.run(["tar", "tzf", archive], capture_output=True, text=True, check=True)
    listed = names.stdout.splitlines()
    assert f"{NAME}/c-1/0/out.csv" in listed
    assert not [name for name in listed if ".cache" in name]


SLOW = """
import time
from pathlib import Path

def each(results_dir, config_dir):
    run = Path(results_dir)
    (run / "half.csv").write_text("a\\n")
    if not results_dir.endswith("c-1/0"):
        time.sleep(600)
    return True, ""

each.per_run = True
"""


def test_an_interruption_ends_at_once_and_claims_nothing_unfinished(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 4, "  - tools/plugins.py:each\n", SLOW)
    vast = [str(Path(sys.executable).with_name("vast"))]
    process = subprocess.Popen(
        [*vast, "results", "postprocess", "-r", tmp_path, "-j", "2"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while len(list(campaign.glob("*/*/half.csv"))) < 3:  # the first run, and one for each worker
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    time.sleep(5)  # the first run's end is heard of
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=180)
    assert process.returncode == 130
    assert "interrupted; finished work is kept" in errors
    plugin = campaign / "_config/tools/plugins.py"
    stamp = plugin.stat()
    summary = work(campaign, time_limit=0.5)
    assert summary.worked == {"c-1/1", "c-2/0", "c-2/1"}
    assert stamp == plugin.stat()


def test_a_full_disk_is_one_message_and_claims_nothing(tmp_path: Path) -> None:
    small = tmp_path / "small"
    small.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=600k", "tmpfs", small]
    if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip("no small file system can be mounted here")
    try:
        fills = PLUGINS.replace(
            '.write_text((run / "out.csv")', '.write_text("x" * 300_000 + (run / "out.csv")'
        )
        campaign = finished_campaign(small, 4, "  - tools/plugins.py:each\n", fills)
        found = failures(campaign)
        assert any(re.search("No space left|disk is full", text) for text in found), found
        assert all("\n" not in text for text in found)
        for path in campaign.glob("*/*/each.csv"):
            path.unlink()
        (campaign / "_config/tools/plugins.py").write_text(PLUGINS)
        assert failures(campaign) == []
        assert len(list(campaign.glob("*/*/each.csv"))) == 4
    finally:
        subprocess.run(["umount", small], check=True)


def test_two_at_once_on_one_campaign_are_refused(tmp_path: Path) -> None:
    from robovast.analysis.postprocessing.state import opened

    campaign = finished_campaign(tmp_path, 1, BOTH, PLUGINS)
    with opened(campaign):
        assert "another `vast results postprocess` is processing it" in failures(campaign)[0]


def test_a_damaged_cache_starts_anew(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1, BOTH, PLUGINS)
    work(campaign)
    (campaign / ".cache/postprocessing.db").write_bytes(b"no database" * 100)
    assert work(campaign).worked == {"c-1/0"}
    assert work(campaign).worked == set()


def test_an_executed_campaign_holds_all_that_its_postprocessing_needs(tmp_path: Path) -> None:
    section = (
        "results_processing:\n  postprocessing:\n"
        "  - command: {script: tools/s.sh}\n  - tools/plugins.py:each\n"
    )
    path = make_campaign(tmp_path / "project", 'printf "v\\n$1\\n" > "$3/out.csv"\n', section)
    (path.parent / "tools").mkdir()
    (path.parent / "tools/plugins.py").write_text(PLUGINS)
    (path.parent / "tools/s.sh").write_text('#!/bin/sh\ncat "$3"/*/*/out.csv > "$3/all.csv"\n')
    campaign = run(path, tmp_path / "results", select="one-1").campaign
    shutil.rmtree(path.parent)
    summaries = postprocess(tmp_path / "results", Options(), Watcher())
    assert summaries[0].failures == []
    assert (campaign / "all.csv").read_text() == "v\n1\n"
    assert (campaign / "one-1/0/each.csv").exists()
    rows = ask([campaign], "SELECT verdict, param_x, each_v FROM runs").rows
    assert rows == [("passed", 1, 1)]
