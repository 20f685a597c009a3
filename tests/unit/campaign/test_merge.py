"""Merging campaigns: equal configurations come together, and nothing is lost or changed."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from support.faults.killing import begin_dying, deaths
from support.faults.small_disk import small_disk

from robovast.base.errors import InputError, StorageError
from robovast.campaign.discovery import find_campaigns
from robovast.campaign.merge import merge_campaigns
from robovast.campaign.planned_runs import planned_runs
from robovast.campaign.run_record import RunRecord, read_run_record
from robovast.campaign.verdict import Verdict

FIRST = "camp-2026-03-05-120000"
SECOND = "camp with spaces-2026-03-06-120000"


def run_record(campaign: str, variant: str, run: int, verdict: Verdict) -> RunRecord:
    return RunRecord(
        campaign=campaign, variant=variant, entry=variant, run=run, id=run, verdict=verdict,
        reason="", started_at="", finished_at="", duration=1.0, exit_code=0, attempt=1,
        job="job-1", runtime="", image="", image_digest="", host="",
    )  # fmt: skip


def make_campaign(
    results: Path, name: str, variants: dict[str, str | None], runs: int, *, records: bool = True
) -> Path:
    """A campaign with `runs` runs of each variant, given by name with its identifier."""
    root = results / name
    for folder in ("_config", "_execution", "_transient", "_jobs/job-1/logs"):
        (root / folder).mkdir(parents=True)
    (root / "_config" / "x.vast").write_text(f"# {name}\n")
    (root / "_execution" / "execution.yaml").write_text(f"runs: {runs}\nimage: some\n")
    configs = [{"name": variant, "config": {"of": name}} for variant in variants]
    (root / "_transient" / "configurations.yaml").write_text(yaml.safe_dump({"configs": configs}))
    (root / "_jobs" / "job-1" / "logs" / "system.log").write_text(name)
    (root / "metadata.yaml").touch()
    for variant, identifier in variants.items():
        (root / variant / "_config").mkdir(parents=True)
        if identifier:
            (root / variant / "_config" / "config.yaml").write_text(
                f"config_identifier: {identifier}\n"
            )
        for number in range(runs):
            folder = root / variant / str(number)
            folder.mkdir()
            (folder / "out.csv").write_text(f"{name} {variant} {number}")
            (folder / "job").symlink_to("../../_jobs/job-1")
            if records:
                run_record(name, variant, number, Verdict.PASSED).write(folder)
    return root


def content(campaign: Path) -> list[str]:
    return sorted(path.read_text() for path in campaign.glob("*/*/out.csv"))


def test_runs_of_equal_configurations_come_together(tmp_path: Path) -> None:
    first = make_campaign(tmp_path, FIRST, {"one-1": "A", "one-2": "B"}, 2)
    second = make_campaign(tmp_path, SECOND, {"other": "A"}, 11)
    before = {path: path.lstat().st_mtime_ns for path in tmp_path.rglob("*")}
    result = merge_campaigns([first, second], tmp_path / "merged")
    assert (result.configurations, result.runs) == (2, 15)
    assert content(result.target) == sorted([*content(first), *content(second)])
    numbers = sorted(int(p.name) for p in (result.target / "one-1").iterdir() if p.name.isdigit())
    assert numbers == list(range(13))
    assert (result.target / "one-1" / "12" / "out.csv").read_text() == f"{SECOND} other 10"
    after = {path: path.lstat().st_mtime_ns for path in before}
    assert after == before, "the campaigns were changed"


@pytest.mark.parametrize("identifier", [f"{FIRST}/one-1", "[1, 2]", "{a: 1}", "5"])
def test_no_identifier_of_others_takes_in_a_configuration_without_one(
    tmp_path: Path, identifier: str
) -> None:
    first = make_campaign(tmp_path, FIRST, {"one-1": None}, 2)
    second = make_campaign(tmp_path, SECOND, {"other": identifier}, 2)
    result = merge_campaigns([first, second], tmp_path / "merged")
    assert (result.configurations, result.runs) == (2, 4)
    for name, origin in (("one-1", FIRST), ("other", SECOND)):
        assert (result.target / name / "1" / "out.csv").read_text() == f"{origin} {name} 1"


def test_that_runs_were_added_to_one_of_them_stays_known(tmp_path: Path) -> None:
    for number, added in enumerate(
        ("", "runs_added: true\n", "more_runs: {hall: 3}\nruns_added: true\n")
    ):
        results = tmp_path / str(number)
        first = make_campaign(results, FIRST, {"hall": "1"}, 2)
        (first / "_execution/execution.yaml").write_text(
            yaml.safe_dump({"runs": 2, **(yaml.safe_load(added) or {})})
        )
        merged = merge_campaigns(
            [first, make_campaign(results, SECOND, {"hall": "1"}, 2)], results / "m"
        )
        record = yaml.safe_load((merged.target / "_execution/execution.yaml").read_text())
        assert record["runs"] == (5 if "more" in added else 4)
        assert record.get("runs_added") == (True if added else None)


def test_a_merged_run_is_a_run_of_the_new_campaign(tmp_path: Path) -> None:
    first = make_campaign(tmp_path, FIRST, {"one-1": "A"}, 1)
    second = make_campaign(tmp_path, SECOND, {"one-1": "A"}, 1)
    merged = merge_campaigns([first, second], tmp_path / "merged").target
    folder = merged / "one-1" / "1"
    record = read_run_record(folder)
    assert record is not None
    assert (record.campaign, record.run, record.id) == ("merged", 1, 1)
    assert record.job == f"{SECOND}/job-1"
    assert (folder / "job" / "logs" / "system.log").read_text() == SECOND
    links = yaml.safe_load((merged / "_transient" / "job_links.yaml").read_text())
    assert links == {"one-1/0": f"{FIRST}/job-1", "one-1/1": f"{SECOND}/job-1"}
    execution = yaml.safe_load((merged / "_execution" / "execution.yaml").read_text())
    assert execution == {"runs": 2, "image": "some", "merged_from": [FIRST, SECOND]}


def test_different_configurations_of_one_name_stay_apart(tmp_path: Path) -> None:
    first = make_campaign(tmp_path, FIRST, {"one": "A"}, 1)
    second = make_campaign(tmp_path, SECOND, {"one": "B", "one_2": "C"}, 1)
    result = merge_campaigns([first, second], tmp_path / "merged")
    configurations = yaml.safe_load(
        (result.target / "_transient" / "configurations.yaml").read_text()
    )
    assert configurations["configs"] == [
        {"name": "one", "config": {"of": FIRST}},
        {"name": "one_3", "config": {"of": SECOND}},
        {"name": "one_2", "config": {"of": SECOND}},
    ]
    assert (result.target / "one_3" / "0" / "out.csv").read_text() == f"{SECOND} one 0"


def test_what_is_made_of_all_runs_is_not_taken_over(tmp_path: Path) -> None:
    first = make_campaign(tmp_path, FIRST, {"one": "A"}, 1)
    merged = merge_campaigns([first], tmp_path / "merged").target
    assert not (merged / "metadata.yaml").exists()


def test_what_cannot_be_merged_is_named(tmp_path: Path) -> None:
    first = make_campaign(tmp_path, FIRST, {"one": "A", "two": None}, 2)
    second = make_campaign(tmp_path, SECOND, {"two": None}, 1)
    run_record(FIRST, "one", 0, Verdict.INTERRUPTED).write(first / "one" / "0")
    result = merge_campaigns([first, second], tmp_path / "merged")
    assert result.left_out == (f"{FIRST}/one/0",)
    assert result.unidentified == (f"{FIRST}/two", f"{SECOND}/two")
    assert (result.configurations, result.runs) == (3, 4)


def test_results_of_others_merge_too(tmp_path: Path) -> None:
    first = make_campaign(tmp_path, FIRST, {"one": "A"}, 2, records=False)
    second = make_campaign(tmp_path, SECOND, {"one": "A"}, 2, records=False)
    (second / "_transient" / "configurations.yaml").unlink()
    result = merge_campaigns([first, second], tmp_path / "merged")
    assert result.runs == 4
    assert not list(result.target.glob("one/*/run.json"))


def test_each_configuration_is_planned_as_before(tmp_path: Path) -> None:
    """What was finished is finished; of what was not, as many runs are missing as before."""
    first = make_campaign(tmp_path, FIRST, {"one": "A", "two": "B"}, 2)
    second = make_campaign(tmp_path, SECOND, {"other": "A", "three": "C"}, 3)
    run_record(SECOND, "three", 2, Verdict.INTERRUPTED).write(second / "three" / "2")
    merged = merge_campaigns([first, second], tmp_path / "merged").target
    plan = planned_runs(yaml.safe_load((merged / "_execution/execution.yaml").read_text()))
    missing = {
        name: plan.of(name) - len(list((merged / name).glob("*/run.json")))
        for name in ("one", "two", "three")
    }
    assert missing == {"one": 0, "two": 0, "three": 1}
    assert not plan.added


def test_campaigns_that_are_folders_of_reports_merge(tmp_path: Path) -> None:
    for name, variants in ((FIRST, ("pick", "place")), (SECOND, ("pick",))):
        for variant in variants:
            (tmp_path / name / variant / "0").mkdir(parents=True)
            (tmp_path / name / variant / "0" / "test.xml").write_text(f"<{variant}/>")
    result = merge_campaigns([tmp_path / FIRST, tmp_path / SECOND], tmp_path / "merged")
    assert result.runs == 3
    found = sorted(path.read_text() for path in result.target.glob("*/0/test.xml"))
    assert found == ["<pick/>", "<pick/>", "<place/>"]


def test_a_link_out_of_the_jobs_is_dropped(tmp_path: Path) -> None:
    first = make_campaign(tmp_path, FIRST, {"one": "A"}, 1)
    link = first / "one" / "0" / "job"
    link.unlink()
    link.symlink_to("../../_jobs/../../../secret")
    merged = merge_campaigns([first], tmp_path / "merged").target
    assert not (merged / "one" / "0" / "job").is_symlink()


def test_campaigns_without_runs_are_refused(tmp_path: Path) -> None:
    first = make_campaign(tmp_path, FIRST, {"one": "A"}, 0)
    with pytest.raises(InputError, match=f"nothing to merge: {FIRST} contain"):
        merge_campaigns([first], tmp_path / "merged")
    assert [path.name for path in tmp_path.iterdir()] == [FIRST]


def test_nothing_is_merged_into_what_is_there(tmp_path: Path) -> None:
    first = make_campaign(tmp_path, FIRST, {"one": "A"}, 1)
    with pytest.raises(StorageError, match="exists already"):
        merge_campaigns([first], first)
    assert json.loads((first / "one" / "0" / "run.json").read_text())["campaign"] == FIRST


def test_campaigns_must_be_told_apart(tmp_path: Path) -> None:
    first = make_campaign(tmp_path / "a", FIRST, {"one": "A"}, 1)
    second = make_campaign(tmp_path / "b", FIRST, {"one": "A"}, 1)
    with pytest.raises(InputError, match=f"two of the campaigns are named {FIRST}"):
        merge_campaigns([first, second], tmp_path / "merged")
    with pytest.raises(InputError, match="no campaigns"):
        merge_campaigns([], tmp_path / "merged")


def test_no_run_comes_twice(tmp_path: Path) -> None:
    first = make_campaign(tmp_path, FIRST, {"one": "A"}, 1)
    second = make_campaign(tmp_path, SECOND, {"one": "A"}, 1)
    merged = merge_campaigns([first, second], tmp_path / "merged").target
    third = make_campaign(tmp_path, "third", {"one": "A"}, 1)
    again = merge_campaigns([merged, third], tmp_path / "again").target
    for both in ([first, merged], [again, second], [merged, again]):
        with pytest.raises(InputError, match=r"both contain the runs of camp.*--campaign"):
            merge_campaigns(both, tmp_path / "twice")
    assert not (tmp_path / "twice").exists()


@pytest.mark.parametrize("records", [True, False])
def test_copies_under_other_names_are_refused(tmp_path: Path, *, records: bool) -> None:
    first = make_campaign(tmp_path, FIRST, {"one": "A"}, 2, records=records)
    for number in range(2):
        run = first / "one" / str(number)
        started = f"2026-03-05T12:00:0{number}.123+00:00"
        if records:
            record = replace(run_record(FIRST, "one", number, Verdict.PASSED), started_at=started)
            record.write(run)
        else:
            start = f'<property name="start_time" value="177000000{number}.123"/>'
            (run / "test.xml").write_text(f"<testsuite><testcase>{start}</testcase></testsuite>")
    shutil.copytree(first, tmp_path / "copy", symlinks=True)
    merged = merge_campaigns([first], tmp_path / "merged").target
    for other in (tmp_path / "copy", merged):
        with pytest.raises(InputError, match="both contain the run"):
            merge_campaigns([first, other], tmp_path / "twice")
    merged = merged.rename(tmp_path / "other name")
    with pytest.raises(InputError, match=r"both contain the run one/0, .* would occur twice"):
        merge_campaigns([tmp_path / "copy", merged], tmp_path / "twice")


def test_a_failure_in_the_middle_leaves_nothing(tmp_path: Path) -> None:
    first = make_campaign(tmp_path, FIRST, {"one": "A"}, 1)
    (first / "one" / "0" / "big").write_bytes(bytes(2**16))
    with small_disk(2**15), pytest.raises(StorageError, match="merged: cannot be written"):
        merge_campaigns([first], tmp_path / "merged")
    assert [path.name for path in tmp_path.iterdir()] == [FIRST]


def test_a_file_of_the_records_name_that_a_run_wrote_comes_along(tmp_path: Path) -> None:
    first = make_campaign(tmp_path, FIRST, {"one": "A"}, 1)
    (first / "one" / "0" / "nav").mkdir()
    (first / "one" / "0" / "nav" / "run.json").write_text("mine")
    merged = merge_campaigns([first], tmp_path / "merged").target
    assert (merged / "one" / "0" / "nav" / "run.json").read_text() == "mine"


@pytest.mark.parametrize("record", [None, "", '{"verdict": "passed"}'])
def test_half_a_run_is_left_out(tmp_path: Path, record: str | None) -> None:
    first = make_campaign(tmp_path, FIRST, {"one": "A"}, 3)
    half = first / "one" / "1" / "run.json"
    half.unlink() if record is None else half.write_text(record)
    result = merge_campaigns([first], tmp_path / "merged")
    assert result.left_out == (f"{FIRST}/one/1",)
    assert result.runs == 2
    assert {path.name for path in (result.target / "one").iterdir()} == {"_config", "0", "1"}


def test_wherever_it_is_killed_no_campaign_but_whole_ones_are_found(tmp_path: Path) -> None:
    def merge(place: Path) -> None:
        first = make_campaign(place, FIRST, {"one": "A"}, 1)
        second = make_campaign(place, SECOND, {"one": "A"}, 1)
        begin_dying()
        merge_campaigns([first, second], place / "merged")

    both = {FIRST, SECOND}
    for number, place in deaths(tmp_path, merge, every=7):
        found = {path.name for path in find_campaigns(place)}
        assert found in (both, {*both, "merged"})
        if not number % 49:
            merge_campaigns(find_campaigns(place)[:2], place / "again")
            assert not [path for path in place.iterdir() if path.name.startswith(".")]
