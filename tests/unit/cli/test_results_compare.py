"""`vast results compare` and `vast results junit`: what users and CI systems get."""

from __future__ import annotations

import json
import os
import re
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from support.campaigns.stored import write, write_campaign

from robovast.campaign.junit import LONGEST

BASE, WORSE, UNCLEAR = (f"hall-2026-03-0{day}-132444" for day in (4, 5, 6))
SPEEDS = [{"speed": speed} for speed in (1.0, 2.0)]


def campaign(results: Path, name: str, bad: dict[float, int], runs: int = 20, **more) -> Path:
    def judge(parameters, number):
        return "failed" if number < bad.get(parameters["speed"], 0) else "passed"

    more = {"variants": SPEEDS, "outputs": False, **more}
    return write_campaign(results, name, runs=runs, judge=judge, **more)


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    results = tmp_path / "results"
    campaign(results, BASE, {2.0: 1})
    campaign(results, WORSE, {2.0: 15})
    campaign(results, UNCLEAR, {2.0: 4})
    return results


def test_what_got_worse_is_named_and_is_an_exit_code(vast, results) -> None:
    outcome = vast("results", "compare", BASE, WORSE)
    assert outcome.code == 1
    head, row, _, verdict, statement, counts = outcome.out.splitlines()
    assert head.split()[:2] == ["CHANGE", "CONFIGURATION"]
    assert row.startswith("worse   hall-2         1 of 20  15 of 20  +70 (+41 to +84)")
    assert verdict == f"{WORSE} compared with {BASE}: worse"
    assert "rose from 2.5 % (1 of 40) to 38 % (15 of 40)" in statement
    assert counts == "2 configurations in both: 1 worse, 0 unclear, 0 better, 1 same."
    better = vast("results", "compare", WORSE, BASE)
    assert (better.code, f"{BASE} compared with {WORSE}: better" in better.out) == (0, True)


def test_several_campaigns_are_a_table(vast, results, tmp_path) -> None:
    reports = ("--markdown", "c.md", "--junit", "c.xml")
    outcome = vast("results", "compare", BASE, UNCLEAR, WORSE, *reports)
    assert outcome.code == 1  # that of the worst
    head, row, *rest = outcome.out.splitlines()
    assert head.split() == ["CONFIGURATION", BASE, UNCLEAR, WORSE]
    assert " ".join(row.split()) == "hall-2 1 of 20 4 of 20 ? 15 of 20 ▲"  # hall-1 did not change
    assert f"{WORSE} compared with {BASE}: worse" in rest
    assert "at least one of 2 campaigns worse in up to 9.8 % of all cases" in rest[-1]
    assert "| hall-2 | 1 of 20 | 4 of 20 ? | 15 of 20 ▲ |" in (tmp_path / "c.md").read_text()
    root = ET.parse(tmp_path / "c.xml").getroot()  # noqa: S314
    assert [suite.get("name") for suite in root] == [UNCLEAR, WORSE]
    asked = vast("results", "compare", BASE, UNCLEAR, BASE, "--fail-on", "unclear", "-o", "json")
    assert asked.code == 6
    data = json.loads(asked.out)["comparisons"]
    assert [(one["base"], one["new"]) for one in data] == [(BASE, UNCLEAR), (BASE, BASE)]


def test_what_is_unclear_fails_only_if_asked_and_says_how_many_more_runs_it_takes(
    vast, results
) -> None:
    outcome = vast("results", "compare", BASE, UNCLEAR)
    assert outcome.code == 0
    assert re.search(
        r"unclear: the rate rose from \S+ % to \S+ %, but chance can explain", outcome.out
    )
    asked = vast("results", "compare", BASE, UNCLEAR, "--fail-on", "unclear", "-o", "json")
    assert asked.code == 6
    data = json.loads(asked.out)
    assert (data["base"], data["new"], data["result"]) == (BASE, UNCLEAR, "unclear")
    assert f"{data['more_runs']} more runs of both campaigns would give a decision" in outcome.out


def test_a_rise_below_the_margin_passes(vast, results) -> None:
    outcome = vast("results", "compare", BASE, UNCLEAR, "--margin", "0.3", "--fail-on", "unclear")
    assert outcome.code == 0
    assert "not worse by 30 % or more" in outcome.out


def test_equal_seeds_make_pairs(vast, results) -> None:
    for name in (BASE, UNCLEAR):
        for record in (results / name).glob("*/*/run.json"):
            data = json.loads(record.read_text())
            record.write_text(json.dumps({**data, "seed": data["id"]}))
    data = json.loads(vast("results", "compare", BASE, UNCLEAR, "-o", "json").out)
    assert data["overall"]["pairs"] == [3, 0]
    assert data["overall"]["p"] == pytest.approx(0.25)


def test_a_comment_and_a_report_are_written(vast, results, tmp_path) -> None:
    vast("results", "compare", BASE, WORSE, "--markdown", "c.md", "--junit", "c.xml")
    comment = (tmp_path / "c.md").read_text()
    assert comment.startswith(f"### worse\n\n`{WORSE}` compared with `{BASE}`: The rate")
    assert "| worse | hall-2 | 1 of 20 | 15 of 20 | +70 (+41 to +84) |" in comment
    root = ET.parse(tmp_path / "c.xml").getroot()  # noqa: S314
    assert (root.get("tests"), root.get("failures")) == ("3", "2")
    failed = [
        case.get("name") for case in root.iter("testcase") if case.find("failure") is not None
    ]
    assert failed == ["all configurations", "hall-2"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((BASE, "gone"), "no campaign `gone`"),
        ((BASE, "other"), "no configuration has equal parameters"),
        ((BASE, "empty"), "has no stored runs"),
        ((BASE, "folder"), "folder contains no campaign"),
        ((BASE, WORSE, "--margin", "-0.1"), "--margin -0.1: the rate must be at least 0"),
        ((BASE, WORSE, "--margin", "nan"), "--margin nan: the rate must be at least 0"),
    ],
)
def test_bad_input_has_one_clear_message(vast, results, arguments, message) -> None:
    campaign(results, "other", {}, variants=[{"speed": 7.0, "name": "x"}])
    campaign(results, "empty", {}, variants=[])
    (results / "folder").mkdir()
    outcome = vast("results", "compare", *arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert message in outcome.err
    assert outcome.is_one_error


def test_a_report_that_cannot_be_written_is_said(vast, results) -> None:
    Path("file").touch()
    outcome = vast("results", "compare", BASE, WORSE, "--junit", "file/c.xml")
    assert outcome.code == 5
    assert outcome.err.startswith("error: file")


REPORT = """<?xml version="1.0"?>
<testsuites><testsuite tests="2"><testcase name="drive" time="1.5"/>
<testcase name="dock"><failure message="no dock">tree\x1b</failure></testcase>
</testsuite></testsuites>"""


def test_a_report_replaces_files_alone(vast, results, tmp_path) -> None:
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to(tmp_path / "real.xml")
    for command in (("junit", BASE, pipe), ("compare", BASE, BASE, "--markdown", pipe)):
        outcome = vast("results", *command)
        assert (outcome.code, f"{pipe}: is a folder, device or pipe" in outcome.err) == (5, True)
        assert pipe.is_fifo()
    for _ in range(2):
        assert vast("results", "junit", BASE, link).code == 0
        assert link.is_symlink()
        assert (tmp_path / "real.xml").read_text().startswith("<?xml")


def test_all_runs_are_one_report(vast, results, tmp_path) -> None:
    root = campaign(results, "small-2026-03-07-132444", {1.0: 1}, runs=4)
    write(root / "hall-1" / "0" / "test.xml", REPORT.replace("\x1b", "x" * 2 * LONGEST))
    write(root / "hall-1" / "1" / "test.xml", REPORT.replace("\x1b", ""))  # its record says passed
    write(root / "hall-1" / "2" / "test.xml", "<!DOCTYPE x><testsuite/>")
    record = root / "hall-2" / "3" / "run.json"
    told = {**json.loads(record.read_text()), "verdict": "errored", "reason": "no \x1b[1m memory"}
    record.write_text(json.dumps(told))
    record = root / "hall-2" / "2" / "run.json"
    record.write_text(json.dumps({**told, "run": 2, "verdict": "interrupted", "reason": ""}))
    outcome = vast("results", "junit", root, "all.xml")
    assert outcome.out == "all.xml: 9 cases of 2 configurations, 2 failed or errored\n"
    report = ET.parse(tmp_path / "all.xml").getroot()  # noqa: S314
    assert [report.get(key) for key in ("tests", "failures", "errors", "skipped")] == list("9111")
    one, two = report
    assert [case.get("name") for case in one] == [
        "run 0: drive",
        "run 0: dock",
        "run 1",
        "run 2",
        "run 3",
    ]
    failure = one[1].find("failure")
    assert (failure.get("message"), len(failure.text)) == ("no dock", LONGEST)
    assert two[3].find("error").get("message") == "no �[1m memory"
    assert two[2].find("skipped").get("message") == "interrupted"


def test_a_campaign_without_runs_has_no_report(vast, results) -> None:
    campaign(results, "empty", {}, variants=[])
    outcome = vast("results", "junit", "empty", "all.xml")
    assert outcome.code == 2
    assert "has no stored runs" in outcome.err


def test_a_campaign_has_no_difference_from_itself_or_its_copy(vast, results, tmp_path) -> None:
    shutil.copytree(results / UNCLEAR, tmp_path / "copies" / UNCLEAR)
    for other in (UNCLEAR, f"copies/{UNCLEAR}"):
        outcome = vast("results", "compare", UNCLEAR, other, "--fail-on", "unclear")
        assert outcome.code == 0
        verdict, statement, counts = outcome.out.splitlines()
        assert verdict == f"{UNCLEAR} compared with {UNCLEAR}: no difference"
        assert statement == "No difference: both have the same 40 runs, 4 of them unsuccessful."
        assert counts == "2 configurations in both: 0 worse, 0 unclear, 0 better, 2 same."


def test_equal_rates_of_other_runs_are_no_difference_that_proves_little(vast, results) -> None:
    later = campaign(results, "hall-2026-03-07-132444", {2.0: 4})
    for record in later.glob("*/*/run.json"):
        record.write_text(record.read_text().replace("2026-03-04T", "2026-03-07T"))
    outcome = vast("results", "compare", UNCLEAR, later.name, "--fail-on", "unclear")
    assert outcome.code == 6
    assert "unclear: no difference, but too few runs to exclude a rise by 5.0 %" in outcome.out
