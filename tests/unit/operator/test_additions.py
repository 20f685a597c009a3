"""Configurations that were applied by hand, and the statuses of all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.kube.fake_cluster import SCENARIO, SETTINGS, accepted, campaign

from robovast.base.errors import InputError
from robovast.campaign.configurations import variants_digest
from robovast.evaluation.launch.cluster_commands import more_in_cluster
from robovast.evaluation.summaries import VariantRuns
from robovast.kubeapi.status import (
    CampaignStatus,
    Condition,
    ConfigurationStatus,
    compact,
    read_status,
)
from robovast.model.document import load_document
from robovast.model.expansion import compose
from robovast.model.packs import Block, Entry, PlanSpec
from robovast_operator.kube.objects import Object
from robovast_operator.kube.untrusted_fields import shaped
from robovast_operator.planning.accept import Files
from robovast_operator.planning.additions import Additions, expand_alone, with_additions
from robovast_operator.planning.campaign import Rejected, Revision
from robovast_operator.planning.configurations import ConfigurationStatuses
from robovast_operator.planning.revisions import Planned, as_planned, next_revision
from robovast_operator.planning.shards import first_attempts
from robovast_operator.pods.jobs import shard_job

FILES = {"scenario.osc": SCENARIO.encode()}


def configuration(name: str, **spec: Any) -> Object:
    """A Configuration; two variants unless it says otherwise."""
    values = {"ParameterVariationList": {"name": "speed", "values": [7, 8]}}
    spec = {"campaign": "drive", **(spec or {"variations": [values]})}
    return {"metadata": {"name": name, "uid": f"uid-{name}", "generation": 1}, "spec": spec}


def added(
    *items: Object,
    files: Files | Rejected | None = FILES,
    known: Any = None,
    planned: Sequence[Revision] = (),
    **spec: Any,
) -> Additions:
    """What Configurations add to the campaign."""
    known = {} if known is None else known
    obj, made, before = campaign(**spec), accepted(**spec), Planned.of_revisions(planned)
    found = with_additions(obj, made, items, known, before)
    if isinstance(files, Rejected):
        return found.without_unknown(files.message)
    for mark, item in found.unknown.items():
        known[mark] = expand_alone(obj, item, files, SETTINGS)
    return with_additions(obj, made, items, known, before)


def planned_with(*steps: Sequence[Object], text: str = "") -> list[Revision]:
    """A campaign's plans after Configurations were there, one set of them after the other."""
    made = accepted()
    made = replace(made, document_text=text or made.document_text)
    revisions: list[Revision] = []
    for items in ((), *steps):
        found = added(*items, planned=revisions).found
        new = next_revision(made, revisions, found, f"plan-{len(revisions)}")
        revisions += [] if new is None else [new]
    return revisions


def names_in(revision: Revision) -> list[str]:
    return [entry["name"] for entry in yaml.safe_load(revision.document)["configuration"]]


def test_each_adds_its_runs_and_a_wrong_one_harms_no_other() -> None:
    wrong = configuration("wrong", parameters=[{"no_such": 1}])
    twice = configuration("hall", parameters=[{"speed": 9}])
    items = [
        configuration("a"),
        wrong,
        twice,
        configuration("b", parameters=[{"speed": 9}], runs=4),
    ]
    found = added(*items)
    numbers = [(one.name, one.expanded.variants, one.runs) for one in found.found]
    assert numbers == [("a", 2, 1), ("b", 1, 4)]
    assert found.problems.keys() == {"wrong", "hall"}
    assert "no_such" in found.problems["wrong"]
    assert "`hall`" in found.problems["hall"]
    assert names_in(planned_with(items)[-1]) == ["hall", "a", "b"]


def test_what_was_planned_keeps_its_place_whatever_becomes_of_configurations(
    tmp_path: Path,
) -> None:
    """Run ids follow from the order of all entries: one that is left out would shift the others."""
    first, other = configuration("a"), configuration("b", parameters=[{"speed": 9}])
    newest = planned_with([first], [other])[-1]
    assert names_in(newest) == ["hall", "a", "b"]
    assert [(b.first_variant, b.variants) for b in newest.plan.blocks] == [(0, 3), (3, 2), (5, 1)]
    (tmp_path / "scenario.osc").write_text(SCENARIO)
    (tmp_path / "drive.vast").write_text(newest.document)
    variants = compose(load_document(tmp_path / "drive.vast"), tmp_path / "out").variants
    by_entry = {
        entry.name: [variant for variant in variants if variant.entry == entry.name]
        for entry in newest.entries
    }
    assert [variant for found in by_entry.values() for variant in found] == list(variants)
    for entry in newest.entries:
        assert entry.digest == variants_digest(by_entry[entry.name])
    whole = as_planned(accepted(select=["hall-1"]), newest)
    assert whole.spec.select == ["hall-1", "a", "b"]
    assert whole.document_text == newest.document


def test_a_configuration_that_is_another_now_adds_nothing() -> None:
    before = planned_with([configuration("a")])
    changed = configuration("a", parameters=[{"speed": 9}], runs=5)
    found = added(changed, planned=before)
    assert not found.found
    assert "Only `runs` may be raised." in found.problems["a"]
    more = configuration("a")
    more["spec"]["runs"] = 5
    (again,) = added(more, planned=before, files=Rejected("SourceNotFound", "gone")).found
    assert (again.runs, again.expanded.variants) == (5, 2)
    grown = next_revision(accepted(), before, [again], "plan-2")
    assert grown is not None
    assert (grown.plan.blocks[-1].first_run, grown.plan.blocks[-1].runs) == (1, 4)
    assert grown.document == before[-1].document


def test_numbers_stay_as_their_author_wrote_them() -> None:
    """The API keeps `1.0` as `1`, of which other variants may come."""
    text = accepted().document_text
    assert "1.0" in text
    revisions = planned_with([configuration("a")], text=text)
    assert "1.0" in revisions[-1].document


@pytest.mark.parametrize("text", ["{", "[1]", "configuration: 3", "configuration: [3]", "[" * 900])
def test_a_plan_whose_document_is_none_is_told_by_its_name(text: str) -> None:
    (first,) = planned_with()
    with pytest.raises(InputError, match="plan-0"):
        Planned.of_revisions([replace(first, document=text)])


def test_what_was_expanded_once_is_not_expanded_again() -> None:
    """However many there are, one more costs its own expansion; nothing new costs none."""
    known: dict[str, Entry | str] = {}
    many = [configuration(f"c{number}") for number in range(5)]
    added(*many, known=known)
    assert [entry.variants for entry in known.values() if isinstance(entry, Entry)] == [2] * 5
    known.update(dict.fromkeys(known, Entry(name="c", variants=3)))  # so that another shows
    found = added(*many, configuration("more"), known=known)
    assert [one.expanded.variants for one in found.found] == [3, 3, 3, 3, 3, 2]
    gone = Rejected("SourceNotFound", "the ConfigMap is not there")
    again = added(*many[1:], configuration("late"), files=gone, known=known)
    assert [one.expanded.variants for one in again.found] == [3, 3, 3, 3]
    assert again.problems == {"late": "the ConfigMap is not there"}
    assert len(known) == 4, "what is gone is not remembered"


def test_the_command_of_the_page_adds_runs_of_chosen_configurations(tmp_path: Path) -> None:
    variants = [
        VariantRuns(f"c-{speed}", "c-2-more" if speed == 1 else "c", {"speed": speed}, ())
        for speed in (1, 2, 3)
    ]
    command = more_in_cluster(tmp_path, "drive-2026", variants, {"c-2", "c-3"})
    begin, *documents, end = "7".join(command.parts).split("\n")
    assert (begin, end, command.of_all) == ("kubectl create -f - <<'END'", "END", False)
    objects = list(yaml.safe_load_all("\n".join(documents).replace("NAME", "drive")))
    assert [item["metadata"] for item in objects] == [{"generateName": "more-"}] * 2
    made = [
        {
            "metadata": {"name": f"more-{n}", "uid": f"uid-{n}", "generation": 1},
            "spec": item["spec"],
        }
        for n, item in enumerate(objects)
    ]
    found = added(*made)
    assert not found.problems
    assert [(one.name, one.runs) for one in found.found] == [("c-2-more-2", 7), ("c-3-more", 7)]
    assert [one.content["parameters"] for one in found.found] == [[{"speed": 2}], [{"speed": 3}]]


def test_where_a_configuration_has_files_the_page_gives_all_more_runs(tmp_path: Path) -> None:
    folder = tmp_path / "drive-2026" / "c-1" / "_config"
    folder.mkdir(parents=True)
    variants = [VariantRuns("c-1", "c", {"map_file": "hall.yaml"}, ())]
    for name, of_all in (("scenario.config", False), ("hall.yaml", True)):
        (folder / name).touch()
        command = more_in_cluster(tmp_path, "drive-2026", variants, {"c-1"})
        assert command.of_all is of_all
    text = """kubectl patch campaign NAME --type merge -p '{"spec": {"runs": 20}}'"""
    assert "20".join(command.parts) == text


def test_a_selection_does_not_leave_out_what_was_added() -> None:
    found = added(configuration("a"), select=["hall-1"])
    assert [(one.name, one.expanded.variants) for one in found.found] == [("a", 2)]


def test_jobs_of_what_was_added_belong_to_the_campaign() -> None:
    """An object goes when its last owner does: with two, deleting the Campaign would leave Jobs."""
    made = accepted()
    first = next_revision(made, (), (), "plan-0")
    assert first is not None
    more = next_revision(made, [first], added(configuration("a")).found, "plan-1")
    assert more is not None
    jobs = [shard_job(made, SETTINGS, s) for s in first_attempts(made.identity, [first, more])]
    assert [job["metadata"]["ownerReferences"] for job in jobs] == [[made.identity.owner]] * 2
    marks = [job["metadata"]["labels"].get("robovast.io/configuration-uid") for job in jobs]
    assert marks == [None, "uid-a"]


@pytest.mark.parametrize("ended", [True, False])
def test_a_status_counts_the_runs_of_its_entry_alone(ended: bool) -> None:
    entries = tuple(Entry(name=n, variants=v) for n, v in (("a", 2), ("b", 1), ("extra", 3)))
    blocks = (
        Block(first_variant=0, variants=3, first_run=0, runs=4),
        Block(first_variant=3, variants=3, first_run=0, runs=2),
        Block(first_variant=0, variants=3, first_run=4, runs=1),
    )
    revision = Revision(0, "plan-0", PlanSpec(blocks=blocks), entries)
    over = Condition(
        type="ResultsAvailable", status="True", reason="", message="", last_transition_time=""
    )
    # a: 0-7, 18-19; b: 8-11, 20; extra: 12-17
    status = CampaignStatus(
        failed_runs="0,7-8", errored_runs="12,19", conditions=[over] if ended else []
    )
    tell = ConfigurationStatuses(revision, status, "2026-01-01T00:00:00Z", {"c": "wrong"})
    found = {name: tell.of(configuration(name)) for name in ("a", "b", "extra", "c")}
    if not ended:
        assert {s.runs.decided for s in found.values()} == {0}
        return
    numbers = {
        n: (s.variants, s.runs.total, s.runs.failed, s.runs.errored) for n, s in found.items()
    }
    assert numbers == {
        "a": (2, 10, 2, 1),
        "b": (1, 5, 1, 0),
        "extra": (3, 6, 0, 1),
        "c": (0, 0, 0, 0),
    }
    assert found["a"].runs.passed == 7
    assert found["c"].conditions[0].status == "False"


def test_a_status_that_is_there_is_not_written_again() -> None:
    """What the store knows is shaped: compared as it stands, it would differ for ever."""
    revision = Revision(
        0,
        "plan-0",
        PlanSpec(blocks=(Block(first_variant=0, variants=1, first_run=0, runs=1),)),
        (Entry(name="a", variants=1),),
    )
    tell = ConfigurationStatuses(revision, CampaignStatus(), "2026-01-01T00:00:00Z", {})
    obj = configuration("a")
    told = tell.of(obj)
    kept = shaped({**obj, "status": compact(told.model_dump(by_alias=True, exclude_none=True))})
    assert tell.of(kept) == told == read_status(ConfigurationStatus, kept["status"])


def test_a_configuration_that_asks_for_too_many_runs_harms_no_other() -> None:
    values = {"ParameterVariationList": {"name": "speed", "values": list(range(99))}}
    many = configuration("many", variations=[values], runs=100_000)
    more = configuration("more", variations=[values], runs=100_000)
    before = planned_with([])
    found = added(many, more, configuration("few"), planned=before)
    assert [one.name for one in found.found] == ["many", "few"]
    assert "19,800,003 runs" in found.problems["more"]
    full = planned_with([many])
    assert [one.name for one in added(many, planned=full).found] == ["many"]
    with pytest.raises(InputError, match="10,200,000 runs, but at most 10,000,000"):
        next_revision(accepted(runs=100_000), full, (), "plan-2")


def test_a_configuration_that_is_made_anew_under_its_name_is_told_to_take_another() -> None:
    before = planned_with([configuration("a")])
    again = configuration("a")
    again["metadata"]["uid"] = "another"
    assert "another `spec.name`" in added(again, planned=before).problems["a"]
    again["spec"]["name"] = "b"
    assert [one.name for one in added(again, planned=before).found] == ["b"]
