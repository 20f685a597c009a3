"""Publishing as the .vast files say: plugins get what they ask for, and their faults are named."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from robovast.analysis.publication.context import PublicationContext
from robovast.analysis.publication.publish import PublishOptions, plan_publication, publish
from robovast.base.errors import (
    CannotRunError,
    DocumentError,
    InputError,
    RobovastError,
    StorageError,
)

CALLS = "results_processing: {publication: [%s]}\n"

PLUGINS = """
from robovast.base.errors import CannotRunError

CALLED = []

def whole(results_dir, config_dir, destination=None):
    CALLED.append(("whole", results_dir, config_dir, destination))
    return True, "done"

def some(results_dir, config_dir, context, **kwargs):
    CALLED.append(("some", [c.name for c in context.campaigns], kwargs, context.files))
    return True, "done", ["a.zip"]

class Upload:
    plugin_type = "upload"
    def __call__(self, results_dir, config_dir, context, overwrite=False):
        CALLED.append(("upload", [path.name for path in context.files], overwrite))
        return (True, "sent")

class Looks:
    def check(self, results_dir, config_dir, context, wish):
        raise CannotRunError("there is no " + wish)
    def __call__(self, results_dir, config_dir, wish, context): ...

class Odd:
    plugin_type = "strange"
    def __call__(self, results_dir, config_dir): ...

class Broken:
    def __init__(self): raise OSError("no disk")

number = 7

def fails(results_dir, config_dir): return False, "no room"
def raises(results_dir, config_dir): raise ValueError("secret of the plugin")
def leaves(results_dir, config_dir): raise SystemExit(3)
def explains(results_dir, config_dir): raise CannotRunError("install it")
def nothing(results_dir, config_dir): pass
def text(results_dir, config_dir): return "done"
def swapped(results_dir, config_dir): return "done", True
def no_paths(results_dir, config_dir): return True, "done", [7]
def needs(results_dir, config_dir, bucket): return True, ""
"""


def make(results: Path, name: str, calls: str, plugins: str = PLUGINS) -> Path:
    config = results / name / "_config"
    config.mkdir(parents=True)
    (config / "x.vast").write_text(f"version: 1\nfuture_section: 1\n{CALLS % calls}")
    (config / "p.py").write_text(plugins)
    return config.parent


def run(campaigns: list[Path], known: int = 0, **options: Any) -> list[str]:
    said: list[str] = []
    override = options.pop("override", None)
    chosen = PublishOptions(**options)
    batches = plan_publication(campaigns, override, known or len(campaigns), chosen)
    publish(batches, chosen, PublicationContext(()), said.append)
    return said


def called(campaign: Path) -> list[Any]:
    from robovast.base.plugins import load_plugin

    found = load_plugin("p.py:CALLED", "", campaign / "_config")
    calls = list(found)
    found.clear()
    return calls


def test_the_guides_plugin_gets_the_folders_and_its_parameters(tmp_path: Path) -> None:
    campaign = make(tmp_path, "a b-2026-01-01-000000", "p.py:whole: {destination: s3://b/}")
    assert run([campaign]) == ["p.py:whole: done"]
    assert called(campaign) == [
        ("whole", str(tmp_path), str(campaign / "_config"), "s3://b/"),
    ]


def test_packing_comes_before_uploading(tmp_path: Path) -> None:
    campaign = make(tmp_path, "a", "p.py:Upload, p.py:some: {x: 1}")
    run([campaign])
    assert called(campaign) == [
        ("some", ["a"], {"x": 1}, ()),
        ("upload", ["a.zip"], False),
    ]


def test_uploading_can_be_skipped(tmp_path: Path) -> None:
    campaign = make(tmp_path, "a", "p.py:Upload, p.py:some")
    run([campaign], skip_upload=True)
    assert [call[0] for call in called(campaign)] == ["some"]


def test_force_reaches_every_plugin_that_knows_overwriting(tmp_path: Path) -> None:
    campaign = make(tmp_path, "a", "p.py:Upload, p.py:some, p.py:whole")
    run([campaign], force=True)
    assert called(campaign) == [
        ("some", ["a"], {"overwrite": True}, ()),
        ("whole", str(tmp_path), str(campaign / "_config"), None),
        ("upload", ["a.zip"], True),
    ]


def test_campaigns_that_ask_for_the_same_are_published_together(tmp_path: Path) -> None:
    first = make(tmp_path, "a", "p.py:some")
    second = make(tmp_path, "b", "p.py:some: {x: 1}")
    third = make(tmp_path, "c", "p.py:some")
    fourth = make(tmp_path, "d", "")
    run([first, second, third, fourth])
    assert [call[1] for call in called(third)] == [["a", "c"]]
    assert [call[1] for call in called(second)] == [["b"]]


def test_a_plugin_for_the_whole_folder_never_gets_more_than_was_chosen(tmp_path: Path) -> None:
    campaign = make(tmp_path, "a", "p.py:some, p.py:whole")
    with pytest.raises(InputError, match="publishes the whole results folder, with 2 campaigns"):
        run([campaign], known=2)
    assert called(campaign) == []


def test_another_file_can_say_what_to_publish(tmp_path: Path) -> None:
    first, second = make(tmp_path / "r", "a", ""), make(tmp_path / "r", "b", "")
    override = make(tmp_path, "mine", "p.py:whole")
    run([first, second], override=override / "_config" / "x.vast")
    assert called(override) == [("whole", str(tmp_path / "r"), str(override / "_config"), None)]


def test_nothing_to_publish_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is nothing to publish"):
        run([make(tmp_path, "a", "")])


WRONG = {
    "p.py:missing": "has no `missing`",
    "zipp": "Did you mean `zip`",
    "p.py:number": "is a int. Write a function",
    "p.py:Odd": "plugin_type 'strange'",
    "p.py:Broken": "cannot be instantiated: OSError: no disk",
    "p.py:whole: {place: x}": "has no parameter `place`. Use one of destination",
    "p.py:needs": "needs the parameter `bucket`",
    "p.py:some: {context: x}": "cannot be given `context`",
}


@pytest.mark.parametrize("call", WRONG)
def test_a_wrong_call_is_refused_before_anything_is_published(tmp_path: Path, call: str) -> None:
    campaign = make(tmp_path, "a", f"p.py:whole, {call}")
    with pytest.raises(InputError, match=WRONG[call]):
        run([campaign])
    assert called(campaign) == []


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ('zip: {filename: "{robot}.zip"}', "has the placeholder `{robot}`"),
        ("zip: {filename: same.zip}", "would both be packed into"),
        ("zip: {omit_hidden: true}", "two files would be `x.vast` in the archive"),
        ("zenodo", "Zenodo needs an access token"),
        ("s3: {bucket: b}", "S3 needs the keys of an account"),
        ("p.py:Looks: {wish: moon}", "^there is no moon$"),
        ("p.py:Looks: {wish: 1}", "`p.py:Looks` failed: TypeError"),
    ],
)
def test_all_look_whether_they_can_before_the_first_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str, said: str
) -> None:
    for name in list(os.environ):
        if name.startswith(("ROBOVAST_", "AWS_")):
            monkeypatch.delenv(name)
    monkeypatch.chdir(tmp_path)
    campaigns = [make(tmp_path, name, f"p.py:some, {call}") for name in "ab"]
    for campaign in campaigns:
        (campaign / "_execution").mkdir()
        (campaign / "_execution" / "x.vast").write_text("")
    with pytest.raises(RobovastError, match=said):
        run(campaigns)
    assert called(campaigns[1]) == []


FAULTS: dict[str, tuple[type[RobovastError], str]] = {
    "fails": (StorageError, "`p.py:fails` failed: no room"),
    "raises": (StorageError, "`p.py:raises` failed: ValueError: secret of the plugin"),
    "leaves": (StorageError, "`p.py:leaves` failed: SystemExit: 3"),
    "explains": (CannotRunError, "^install it$"),
    "nothing": (StorageError, r"returned None. Return \(success, message\)"),
    "text": (StorageError, "returned 'done'"),
    "swapped": (StorageError, "returned"),
    "no_paths": (StorageError, r"not paths: \[7\]"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_of_a_plugin_is_named_and_ends_it(tmp_path: Path, name: str) -> None:
    campaign = make(tmp_path, "a", f"p.py:{name}, p.py:whole")
    kind, message = FAULTS[name]
    with pytest.raises(kind, match=message):
        run([campaign])
    assert called(campaign) == []


def test_a_wrong_section_is_shown_in_its_file(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=r"x\.vast:3:\d+: results_processing\.publication\[0\]"):
        run([make(tmp_path, "a", "{zip: 1}")])


def test_the_file_of_a_campaign_with_several_is_the_recorded_one(tmp_path: Path) -> None:
    campaign = make(tmp_path, "a", "p.py:some")
    (campaign / "_config" / "other.vast").touch()
    with pytest.raises(InputError, match=r"does not contain the \.vast file of the campaign"):
        run([campaign])
    (campaign / "_transient").mkdir()
    (campaign / "_transient" / "configurations.yaml").write_text("vast: x.vast\n")
    run([campaign])
