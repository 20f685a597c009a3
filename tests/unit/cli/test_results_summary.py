"""`vast results summary`: what a user sees."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from support.campaigns.searches import write_search
from support.campaigns.stored import NAME, write_campaign


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A campaign of three configurations with 40 runs each."""
    monkeypatch.chdir(tmp_path)
    shares = {1.0: 0, 2.0: 5, 3.0: 30}
    write_campaign(
        tmp_path / "results",
        variants=[{"speed": speed} for speed in shares],
        runs=40,
        judge=lambda parameters, number: (
            "failed" if number < shares[parameters["speed"]] else "passed"
        ),
        outputs=False,
    )
    return tmp_path / "results"


def test_configurations_are_failing_inconclusive_or_passing(vast, results) -> None:
    outcome = vast("results", "summary", NAME)
    assert outcome.code == 0
    lines = [line.split() for line in outcome.out.splitlines()]
    assert lines[1][:9] == ["hall-3", "failing", "30", "of", "40", "75", "%", "60", "–"]
    assert lines[2][:8] == ["hall-2", "inconclusive", "5", "of", "40", "12", "%", "5.5"]
    assert lines[3][:8] == ["hall-1", "passing", "0", "of", "40", "0", "%", "0"]
    assert outcome.out.endswith(
        "3 configurations: 1 failing, 1 inconclusive, 1 passing (threshold 10 %)\n"
        "120 of 120 runs stored: 85 passed, 35 failed, 0 errored, 0 interrupted\n"
        "29 % of the runs were unsuccessful (95 % interval 22 – 38 %)\n"
        f"hall-2 needs the fewest runs for a decision ({lines[2][11]} more): vast exec local run "
        f"--resume=results/{NAME} --config=hall-2 --runs={40 + int(lines[2][11])}\n"
    )


def test_a_folder_of_one_campaign_will_do_and_the_table_can_be_short(vast, results) -> None:
    for place in (results, results / NAME, f"{results / NAME}/"):
        outcome = vast("results", "summary", place, "--worst", 1)
        assert (
            "… and 2 more: 0 failing, 1 inconclusive, 1 passing (`--worst 0` shows all)"
            in outcome.out
        )


def test_json_has_everything(vast, results) -> None:
    data = json.loads(vast("results", "summary", NAME, "-o", "json", "--limit", "0.5").out)
    assert (data["campaign"], data["interval"], data["limit"]) == (NAME, "wilson", 0.5)
    assert data["states"] == {"broken": 1, "undecided": 0, "sound": 2}
    first = data["configurations"][0]
    assert (first["name"], first["parameters"], first["rate"]["failed"]) == (
        "hall-3",
        {"speed": 3.0},
        30,
    )


def test_it_says_why_runs_fail_and_which_parameter_makes_them(vast, results) -> None:
    outcome = vast("results", "summary", NAME)
    assert "35    goal not reached: no goal after 20 s  failed   hall-2/0\n" in outcome.out
    assert "No factor explains the failures better than chance." in outcome.out
    write_campaign(
        results,
        "margins",
        variants=[{"margin": margin, "x": x} for margin in (0.02, 0.1) for x in range(6)],
        runs=10,
        judge=lambda parameters, number: (
            "failed" if number < (8 if parameters["margin"] < 0.05 else 1) else "passed"
        ),
        outputs=False,
    )
    outcome = vast("results", "summary", "margins")
    assert "margin  ≤ 0.02    80 % of 60    10 % of 60  +5" in outcome.out
    (effect, _) = json.loads(vast("results", "summary", "margins", "-o", "json").out)["effects"]
    assert (effect["factor"], effect["worse"]) == (
        "margin",
        {"condition": "≤ 0.02", "bad": 48, "runs": 60},
    )


def test_while_runs_are_missing_it_says_which_intervals_these_are(vast, results) -> None:
    path = results / NAME / "_execution" / "execution.yaml"
    path.write_text(path.read_text().replace("runs: 40", "runs: 50"))
    outcome = vast("results", "summary", NAME)
    assert "120 of 150 runs stored" in outcome.out
    assert "\nRuns are missing, so all intervals are wider and valid at any time." in outcome.out
    assert outcome.out.endswith(f"\nContinue: vast exec local run --resume=results/{NAME}\n")


def test_runs_that_were_added_are_not_called_missing(vast, results) -> None:
    path = results / NAME / "_execution" / "execution.yaml"
    path.write_text(
        path.read_text().replace("runs: 40", "runs: 30\nmore_runs: {hall-3: 40}\nruns_added: true")
    )
    out = vast("results", "summary", NAME).out
    assert "\nRuns were added after the verdicts were visible, so all" in out
    assert "missing" not in out


@pytest.mark.parametrize(
    ("batches", "ended", "more"),
    [(4, True, " --batches=6"), (1, True, " --batches=2"), (2, False, "")],
)
def test_a_search_is_given_batches_and_its_intervals_hold_however_often_one_looks(
    vast, tmp_path: Path, batches: int, ended: bool, more: str
) -> None:
    budget = [{"batches": batches if ended else 9}]
    root = write_search(tmp_path / "results", batches=batches, budget=budget, stopping=[])
    outcome = vast("results", "summary", root)
    command = f"vast exec local run --resume={root}{more}\n"
    assert outcome.out.endswith(f"\nContinue: {command}")
    assert "\nThe search chose its runs by the verdicts, so all" in outcome.out
    data = json.loads(vast("results", "summary", root, "-o", "json").out)
    assert (data["interval"], f"{data['next']}\n") == ("anytime", command)


def test_a_search_in_a_folder_named_from_here_is_given_batches(
    vast, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = write_search(tmp_path / "results", batches=1, budget=[{"batches": 1}], stopping=[])
    monkeypatch.chdir(tmp_path)
    outcome = vast("results", "summary", Path("results") / root.name)
    assert " --batches=2\n" in outcome.out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nothing",), "no campaign `nothing`"),
        ((NAME, "--limit", "1"), "--limit 1: the rate must be above 0 and below 1"),
        ((NAME, "--limit", "nan"), "--limit nan: the rate must be above 0 and below 1"),
        ((".",), "contains no campaign"),
    ],
)
def test_bad_input_has_one_clear_message(vast, results, arguments, message) -> None:
    outcome = vast("results", "summary", *arguments)
    assert outcome.code == 2
    assert outcome.err.startswith("error: ")
    assert message in outcome.err
    assert outcome.is_one_error


def test_several_campaigns_must_be_named_and_one_without_runs_says_nothing(vast, results) -> None:
    write_campaign(results, "other-2026-03-05-132444", variants=[])
    for words in ([results], []):
        outcome = vast("results", "summary", *words)
        told = f"contains 2 campaigns ({NAME}, other-2026-03-05-132444)\nhint: name one of them"
        assert (outcome.code, told in outcome.err) == (2, True)
    empty = vast("results", "summary", "other-2026-03-05-132444")
    assert empty.code == 2
    assert "other-2026-03-05-132444 has no stored runs" in empty.err


def test_without_any_campaign_the_way_to_the_first_one_is_named(
    vast, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = vast("results", "summary")
    assert outcome.code == 2
    assert outcome.err == (
        "error: there are no campaigns yet: the results folder results does not exist\n"
        "hint: run `vast exec local run`, or name another results folder with `-r`\n"
    )


def test_a_long_reason_is_cut_where_one_sees_it_and_one_configuration_is_no_plural(
    vast, results
) -> None:
    campaign = write_campaign(results, "one", variants=[{"x": 1}], judge=lambda *_: "failed")
    reasons = ("a collision after 5.7 s at 0.57, -0.85", "a collision " + "far away " * 20)
    for number, reason in enumerate(reasons):
        file = campaign / "hall-1" / str(number) / "run.json"
        file.write_text(json.dumps(json.loads(file.read_text()) | {"reason": reason}))
    out = vast("results", "summary", "one").out
    assert f"{reasons[0]} " in out
    assert f"1     {reasons[1][:59]}…  failed" in out
    assert "\n1 configuration: " in out


HOSTILE = "cut \ud800, cleared \x9b2J, turned \u202e round"


@pytest.mark.parametrize("is_terminal", [False, True])
def test_a_hostile_reason_is_shown_and_not_obeyed(
    vast, results, monkeypatch: pytest.MonkeyPatch, is_terminal: bool
) -> None:
    for number in range(30):
        file = results / NAME / "hall-3" / str(number) / "run.json"
        file.write_text(json.dumps(json.loads(file.read_text()) | {"reason": HOSTILE}))
    monkeypatch.setattr("sys.stdout.isatty", lambda: is_terminal)
    text, data = (vast("results", "summary", NAME, "-o", form) for form in ("text", "json"))
    assert (text.code, data.code) == (0, 0)
    for out in (text.out, data.out):
        assert not {"\ud800", "\x9b", "\u202e"} & set(out)
    assert json.loads(data.out)["configurations"][0]["reason"] == HOSTILE.replace("\ud800", "?")
    assert vast("results", "junit", NAME, "report.xml").code == 0
    assert vast("results", "compare", NAME, NAME, "--markdown", "report.md").code == 0


def test_a_run_with_an_impossible_number_is_not_left_out_without_a_word(vast, results) -> None:
    shutil.copytree(results / NAME / "hall-1" / "0", results / NAME / "hall-1" / "00")
    outcome = vast("results", "summary", NAME)
    assert outcome.code == 0
    assert "120 of 120 runs stored" in outcome.out
    assert outcome.err.startswith("warning: hall-1/00 is not counted: the number of a run has")
