"""Describes a search: who proposed each of its sets, from what, and what came of it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from robovast.analysis.provenance.contributions import Node
from robovast.analysis.provenance.problems import Findings
from robovast.analysis.provenance.run_nodes import EXECUTION, compact
from robovast.analysis.provenance.times import from_epoch
from robovast.analysis.provenance.vocabulary import SOFTWARE, path_iri
from robovast.base.safe_paths import MOST_OF_ALL, read_file
from robovast.campaign.layout import Layout

_STRATEGY = "search/strategy"
_PROPOSED = ("strategy", "version", "seed", "told")
_SCORED = ("objectives", "measures", "n_samples", "error")


def describe_search(layout: Layout, findings: Findings) -> list[dict[str, Any]]:
    """The batches of a search, with their sets; none if the campaign is no search.

    Args:
        layout: of the campaign.
        findings: collects the first file that cannot be read; later batches are left out.
    """
    batches: list[dict[str, Any]] = []
    while os.path.isfile(path := layout.batch(len(batches))):
        try:
            batches.append(_batch(layout, len(batches)))
        except (OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError):
            findings.missing("batches of the search that cannot be read", path.name)
            break
    return batches


def _batch(layout: Layout, number: int) -> dict[str, Any]:
    """A batch; whatever is wrong with its files is raised as it comes."""
    made = _read(layout, number)
    scored = os.path.isfile(layout.batch(number, ".result"))
    outcome = _read(layout, number, ".result") if scored else {}
    scores = {score["id"]: score for score in outcome.get("scores", ())}
    return {
        "batch": number,
        **{key: made[key] for key in _PROPOSED},
        "known": number - made.get("ahead", 0),
        "scored_at": from_epoch(outcome.get("finished_at")),
        "sets": [
            {"id": params["id"], "config": config, **_scored(scores.get(params["id"]))}
            for params, config in zip(made["sets"], made["configs"], strict=True)
        ],
    }


def _scored(score: Mapping[str, Any] | None) -> dict[str, Any]:
    return {key: score[key] for key in _SCORED} if score is not None else {}


def _read(layout: Layout, number: int, part: str = "") -> dict[str, Any]:
    content = read_file(layout.batch(number, part), layout.root, MOST_OF_ALL)
    found: dict[str, Any] = json.loads(content)
    return found


def search_nodes(batches: Iterable[Mapping[str, Any]], document: str | None) -> Iterator[Node]:
    """Nodes of a search.

    All evaluations that a batch was proposed from are the members of the collection that it used,
    and of those from which that one derives: so the graph grows with the sets, not their square.

    Args:
        batches: what `describe_search` returned.
        document: IRI of the .vast file.
    """
    proposed: set[str] = set()
    for batch in batches:
        if batch["batch"] == 0:
            kinds = ["Agent", "SoftwareAgent", "robovast:SearchStrategy"]
            yield {"@id": _STRATEGY, "@type": kinds, "name": batch["strategy"]}
        yield from _proposal(batch, document, proposed)
        if batch.get("scored_at"):
            yield from _scoring(batch)


def _proposal(batch: Mapping[str, Any], document: str | None, proposed: set[str]) -> Iterator[Node]:
    """The activity that proposed a batch, and the sets that are new."""
    iri, ids = f"search/batch-{batch['batch']}", _unique(batch["sets"], "id")
    known = [_evaluated(batch["known"] - 1)] if batch["known"] else []
    yield {
        "@id": iri,
        "@type": ["Activity", "robovast:Proposal"],
        "used": [*([document] if document else []), *known],
        "wasAssociatedWith": [_STRATEGY, SOFTWARE],
        "wasInfluencedBy": EXECUTION,
        "batch": batch["batch"],
        **{key: batch[key] for key in _PROPOSED},
        "proposed": [{"@id": _set(id_)} for id_ in ids],
    }
    for id_, params in ids.items():
        if id_ not in proposed:
            proposed.add(id_)
            kinds = ["Entity", "robovast:ParameterSet"]
            yield {"@id": _set(id_), "@type": kinds, "wasGeneratedBy": iri}
            made = {"@id": _configuration(params), "@type": ["Entity"]}
            yield {**made, "wasDerivedFrom": _set(id_)}


def _scoring(batch: Mapping[str, Any]) -> Iterator[Node]:
    """The activity that scored a batch, the evaluations, and their collection."""
    number, sets = batch["batch"], _unique(batch["sets"], "config").values()
    iri = f"search/batch-{number}/scoring"
    names = [f"search/batch-{number}/{path_iri(params['config'])}" for params in sets]
    yield {
        "@id": iri,
        "@type": ["Activity", "robovast:Scoring"],
        "used": [_configuration(params) for params in sets],
        "wasAssociatedWith": SOFTWARE,
        "wasInfluencedBy": EXECUTION,
        "endedAtTime": batch["scored_at"],
    }
    for name, params in zip(names, sets, strict=True):
        yield compact(
            {
                "@id": name,
                "@type": ["Entity", "robovast:Evaluation"],
                "wasGeneratedBy": iri,
                "wasDerivedFrom": _configuration(params),
                "objective": _numbers(params["objectives"]),
                "measure": _numbers(params["measures"]),
                "n_samples": params["n_samples"],
                "error": params["error"],
            }
        )
    yield compact(
        {
            "@id": _evaluated(number),
            "@type": ["Entity", "Collection", "robovast:Evaluations"],
            "wasGeneratedBy": iri,
            "hadMember": names,
            "wasDerivedFrom": _evaluated(number - 1) if number else None,
        }
    )


def _unique(sets: Iterable[Mapping[str, Any]], key: str) -> dict[str, Mapping[str, Any]]:
    """Sets by one of their keys; one that stands twice is one."""
    return {params[key]: params for params in sets}


def _set(id_: str) -> str:
    return f"search/sets/{path_iri(id_)}"


def _configuration(params: Mapping[str, Any]) -> str:
    return path_iri(f"{params['config']}/")


def _evaluated(number: int) -> str:
    return f"search/evaluated-{number}"


def _numbers(given: Mapping[str, float]) -> list[Node]:
    return [{"name": name, "value": value} for name, value in given.items()]
