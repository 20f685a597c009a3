"""The queries of the developer guide, by the package, as raw text and in plain rdflib."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import rdflib
from support.campaigns.described import make_old_campaign
from support.campaigns.searches import write_search

from robovast.analysis.provenance import describe
from robovast.analysis.provenance.query import Graphs, query_names, read_query
from robovast.base.errors import CannotRunError, InputError
from robovast.campaign.discovery import find_campaigns
from robovast.campaign.layout import Layout
from robovast.search.history import SearchHistory


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = make_old_campaign(tmp_path_factory.mktemp("results"))
    describe(root)
    return root


ROWS = {
    "floorplan-models": 2,
    "vast-file": 1,
    "floorplan-transformation": 2,
    "floorplan-generation": 2,
    "scenario-generation": 2 * 2,  # scenarios and their goals
    "test-results": 4 * 3 * 5,  # runs × used × written
    "bag-postprocessing": 4,
    "metadata-and-graph": 1,
    "variation-types": 2 * 2,
    "failure-rate": 2,
    "failed-runs": 2,  # one run, two logs
}


OF_SEARCHES = {
    "proposed-sets": 3 * 4,  # batches × sets
    "proposed-from": (0 + 4 + 8) * 2,  # evaluations before each batch × their numbers
}


@pytest.fixture(scope="module")
def searched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A search of three batches of four sets."""
    results = tmp_path_factory.mktemp("searched") / "results"
    root = write_search(results, batches=3, runs=False, strategy="random", per_batch=4)
    describe(root)
    return root


def test_every_query_of_the_package_is_tested() -> None:
    assert ROWS.keys() | OF_SEARCHES.keys() == query_names().keys()


@pytest.mark.filterwarnings("ignore:ConjunctiveGraph is deprecated:DeprecationWarning")
@pytest.mark.parametrize(("name", "rows"), OF_SEARCHES.items())
def test_queries_about_searches_work_here_and_in_plain_rdflib(
    searched: Path, name: str, rows: int
) -> None:
    answer = Graphs([searched]).ask(read_query(name))
    found = list(answer)
    assert len(found) == rows
    assert None not in {cell for row in found for cell in row}
    graph = rdflib.Graph().parse(searched / "metadata.prov.json")
    assert len(list(graph.query(read_query(name)))) == rows


def test_each_set_says_who_proposed_it_from_what(searched: Path) -> None:
    graphs, history = Graphs([searched]), SearchHistory(Layout(searched))
    answer = graphs.ask(read_query("proposed-sets"))
    rows = [dict(zip(answer.columns, row, strict=True)) for row in answer]
    told = {
        config: (batch.number, made.strategy, made.version, made.seed, made.told)
        for batch in history.batches
        for made in [batch.proposal]
        for config in made.configs
    }
    assert {
        row["config"].rstrip("/").rpartition("/")[2]: (
            row["batch"], row["strategy"], row["version"], row["seed"], row["told"]
        )
        for row in rows
    } == told  # fmt: skip
    scored = history.finished[0].outcome
    assert scored is not None
    values = [score.objectives["failure_rate"] for score in scored.scores]
    evidence = [row for row in graphs.ask(read_query("proposed-from")) if row[0] == 1]
    assert sorted(value for _, _, name, value, _ in evidence if name == "failure_rate") == sorted(
        values
    )


@pytest.mark.parametrize(("name", "rows"), ROWS.items())
def test_every_query_has_rows_without_a_missing_cell(campaign: Path, name: str, rows: int) -> None:
    answer = Graphs([campaign]).ask(read_query(name))
    found = list(answer)
    assert len(found) == rows
    optional = {"start_time", "end_time"} if name == "bag-postprocessing" else set()
    optional |= {"agent"} if name == "floorplan-generation" else set()
    for row in found:
        cells = dict(zip(answer.columns, row, strict=True))
        assert None not in {cells[key] for key in cells.keys() - optional}, cells


@pytest.mark.filterwarnings("ignore:ConjunctiveGraph is deprecated:DeprecationWarning")
@pytest.mark.parametrize(("name", "rows"), ROWS.items())
def test_every_query_works_in_plain_rdflib(campaign: Path, name: str, rows: int) -> None:
    graph = rdflib.Graph()
    graph.parse(str(campaign / "metadata.prov.json"))
    assert len(list(graph.query(read_query(name)))) == rows


def test_the_failure_rate_is_right(campaign: Path) -> None:
    rows = sorted(Graphs([campaign]).ask(read_query("failure-rate")))
    assert [(row[0].rpartition("/")[2], *row[1:]) for row in rows] == [
        ("hall.fpm", 0.0, 2),
        ("ramp.fpm", 50.0, 2),
    ]


# As the guide prints them, without the brace at the end.
UNCLOSED = {
    "scenario-generation": """\
SELECT ?vast_file ?ref_file ?activity ?agent ?gen_file
WHERE {
?vast_file rdf:type robovast:VastConfiguration .
?activity prov:used ?vast_file .
?vast_file dcterms:references ?ref_file .
?gen_file prov:wasGeneratedBy ?activity .
OPTIONAL {?activity prov:wasAssociatedWith ?agent .}
""",
    "test-results": """\
SELECT ?scenario ?config_files ?activity ?agent ?gen_file ?start_time ?end_time
WHERE {
?scenario rdf:type smm:ConcreteScenario .
?activity prov:used ?scenario .
?activity prov:used ?config_files .
OPTIONAL{?activity prov:startedAtTime ?start_time .}
OPTIONAL{ ?activity prov:endedAtTime ?end_time . }
?gen_file prov:wasGeneratedBy ?activity .
OPTIONAL {?activity prov:wasAssociatedWith ?agent .}
""",
}


@pytest.mark.parametrize(("name", "text"), UNCLOSED.items())
def test_a_query_that_is_not_closed_says_so(campaign: Path, name: str, text: str) -> None:
    with pytest.raises(InputError) as caught:
        Graphs([campaign]).ask(text)
    assert "1 `}` is missing." in str(caught.value)
    assert f"`vast results sparql {name}`" in str(caught.value)


def test_a_missing_dot_before_optional_does_no_harm(campaign: Path) -> None:
    text = read_query("metadata-and-graph").replace("?metadata_file .\n", "?metadata_file\n")
    assert len(list(Graphs([campaign]).ask(text))) == 1


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("SELECT * WHERE { ?s sosa:x ?o }", "Unknown prefix: sosa; known are rdf, "),
        ("SELECT * WHERE { ?s ?p ?o }}", "1 `{` is missing."),
        ("SELECT ?x WHERE { ?s ?p \"}\" ", "1 `}` is missing."),
        ("DELETE WHERE { ?s ?p ?o }", "the query is wrong"),
        ("", "the query is wrong"),
    ],
)  # fmt: skip
def test_a_wrong_query_says_what_may_be_meant(campaign: Path, text: str, cause: str) -> None:
    with pytest.raises(InputError) as caught:
        Graphs([campaign]).ask(text)
    assert cause in str(caught.value)


def test_a_query_may_declare_a_prefix_of_its_own(campaign: Path) -> None:
    text = "PREFIX prov: <http://x/> PREFIX y: <http://y/> ASK { ?s prov:used ?o . ?o y:a ?b }"
    graphs = Graphs([campaign])
    assert list(graphs.ask(text)) == [(False,)]
    assert graphs.ask(text).csv() == "answer\nfalse\n"


def test_triples_have_three_columns(campaign: Path) -> None:
    answer = Graphs([campaign]).ask("CONSTRUCT { ?s a ?t } WHERE { ?s a robovast:Campaign ; a ?t }")
    assert answer.columns == ["subject", "predicate", "object"]
    assert len(list(answer)) == 2


def test_two_campaigns_of_one_name_cannot_be_mixed(tmp_path: Path) -> None:
    roots = [make_old_campaign(tmp_path / place, 1, 1) for place in ("a", "b")]
    for root in roots:
        describe(root)
    with pytest.raises(InputError, match="could not be distinguished"):
        Graphs(roots)
    path = roots[1] / "_config/hall.vast"
    path.write_text(path.read_text().replace("datasets/halls/", "datasets/other/"))
    describe(roots[1])
    assert len(Graphs(roots).campaigns) == 2


def test_without_the_extra_the_message_names_it(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyoxigraph", None)
    with pytest.raises(CannotRunError, match=r"\[query\]"):
        Graphs([campaign])


def test_campaigns_are_found(tmp_path: Path) -> None:
    first = make_old_campaign(tmp_path, 1, 1)
    second = make_old_campaign(tmp_path, 1, 1, name="merged by hand")
    aborted = tmp_path / "aborted-2026-01-01-000000"
    aborted.mkdir()
    (tmp_path / "notes").mkdir()
    assert find_campaigns(tmp_path) == [aborted, first, second]
    assert find_campaigns(first) == [first]
    with pytest.raises(InputError, match="contains no campaign"):
        find_campaigns(tmp_path / "notes")
    with pytest.raises(InputError, match="no such folder"):
        find_campaigns(tmp_path / "nowhere")
