"""metadata.prov.json: parsable offline, valid PROV, with what hooks contribute."""

from __future__ import annotations

import json
import socket
from dataclasses import replace
from pathlib import Path

import pytest
import rdflib
from rdflib import PROV, RDF, Literal, URIRef
from rdflib.compare import isomorphic
from support.campaigns.described import DATASET, NAME, RECORD, make_old_campaign, nodes_of
from support.campaigns.searches import write_search

from robovast.analysis.provenance import PluginFaultsError, describe, write_graph, write_metadata
from robovast.analysis.provenance.reading import list_files
from robovast.analysis.provenance.vocabulary import PREFIXES, ROBOVAST
from robovast.base.serialization import dump_yaml
from robovast.base.yaml_files import parse_yaml
from robovast.campaign.verdict import Verdict

SHAPES = Path(__file__).with_name("prov-constraints.ttl")
BASE = f"{DATASET}{NAME}/"
VAST = rdflib.Namespace(ROBOVAST)
LONG_AGO = Literal("2020-01-01T00:00:00Z", datatype=rdflib.XSD.dateTime)

# rdflib's JSON-LD parser and serializer warn of rdflib's own class.
pytestmark = pytest.mark.filterwarnings("ignore:ConjunctiveGraph is deprecated:DeprecationWarning")


@pytest.fixture(autouse=True)
def offline(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError("the graph must be readable without a network")

    monkeypatch.setattr(socket.socket, "connect", refuse)


@pytest.fixture(scope="module")
def described(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign with its graph, only to read."""
    root = make_old_campaign(tmp_path_factory.mktemp("results"))
    describe(root)
    return root


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """A campaign without a graph."""
    return make_old_campaign(tmp_path)


def load(root: Path) -> rdflib.Graph:
    return rdflib.Graph().parse(root / "metadata.prov.json")


def iri(path: str) -> URIRef:
    return URIRef(BASE + path)


def violations(graph: rdflib.Graph) -> str:
    from pyshacl import validate

    shapes = rdflib.Graph().parse(SHAPES)
    conforms, _, text = validate(graph, shacl_graph=shapes, advanced=True)
    return "" if conforms else text


def test_the_graph_keeps_the_prov_constraints(described: Path) -> None:
    assert violations(load(described)) == ""


def test_the_graph_of_a_search_keeps_them_and_grows_with_its_sets(tmp_path: Path) -> None:
    sizes = []
    for batches in (2, 4):
        root = write_search(tmp_path / str(batches), batches=batches, runs=False, strategy="random")
        describe(root)
        assert violations(load(root)) == ""
        sizes.append(len(load(root)))
    one, other = sizes
    assert other < 2.2 * one


def test_a_search_whose_batch_is_damaged_is_described_up_to_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    root = write_search(tmp_path, batches=3, runs=False, strategy="random")
    (root / "_execution/search/batch-0001.result.json").write_text('{"scores": [7]}')
    describe(root)
    assert "batches of the search that cannot be read: batch-0001.json" in caplog.text
    assert len(parse_yaml((root / "metadata.yaml").read_text())["search"]) == 1


@pytest.mark.parametrize(
    ("subject", "predicate", "value"),
    [
        (iri("hall-1-1/0"), PROV.endedAtTime, LONG_AGO),
        (iri("hall-1-1/0"), RDF.type, PROV.Entity),
        (iri("hall-1-1/0/test.xml"), PROV.wasGeneratedBy, iri("hall-1-1/1")),
        (iri("_config/hall.vast"), PROV.wasDerivedFrom, iri("hall-1-1/")),
        (iri("hall-1-1/0"), PROV.used, iri("nowhere")),
        (iri("hall-1-1/0"), VAST.success, Literal("yes")),
    ],
)  # fmt: skip
def test_the_shapes_notice_what_is_wrong(
    described: Path, subject: URIRef, predicate: URIRef, value: rdflib.term.Node
) -> None:
    graph = load(described)
    graph.add((subject, predicate, value))
    if predicate == PROV.wasDerivedFrom:
        graph.add((iri("hall-1-1/"), PROV.wasDerivedFrom, subject))
    assert violations(graph)


@pytest.mark.parametrize("form", ["turtle", "json-ld", "nt", "xml"])
def test_the_graph_survives_a_round_trip(described: Path, form: str) -> None:
    graph = load(described)
    again = rdflib.Graph().parse(data=graph.serialize(format=form), format=form)
    assert isomorphic(graph, again)


def test_two_parsers_read_the_same_triples(described: Path) -> None:
    import pyoxigraph

    store = pyoxigraph.Store()
    store.load(path=str(described / "metadata.prov.json"), format=pyoxigraph.RdfFormat.JSON_LD)
    text = store.dump(format=pyoxigraph.RdfFormat.N_TRIPLES, from_graph=pyoxigraph.DefaultGraph())
    assert isomorphic(load(described), rdflib.Graph().parse(data=text, format="nt"))


def test_the_context_is_whole_and_inline(described: Path) -> None:
    context = json.loads((described / "metadata.prov.json").read_text())["@context"]
    assert context["@base"] == BASE
    for prefix in ("robovast", "smm", "env", "agn", "qudt", "unit", "prov", "dcterms", "foaf"):
        assert context[prefix] == PREFIXES[prefix]


def test_success_is_a_boolean(described: Path) -> None:
    graph = load(described)
    assert graph.value(iri("hall-1-1/0"), VAST.success).value is True
    assert graph.value(iri("hall-1-2/0"), VAST.success).value is False


def test_an_interrupted_run_has_no_success(campaign: Path) -> None:
    replace(RECORD, verdict=Verdict.INTERRUPTED, started_at="").write(campaign / "hall-1-1/0")
    describe(campaign)
    graph = load(campaign)
    assert graph.value(iri("hall-1-1/0"), VAST.success) is None
    assert str(graph.value(iri("hall-1-1/0"), VAST.verdict)) == "interrupted"


def test_what_a_hook_contributes_is_merged(described: Path) -> None:
    graph = load(described)
    model, image = iri("_config/hall.fpm"), iri("hall-1-1/maps/hall.pgm")
    references = set(graph.objects(iri("hall-1-1/"), URIRef(f"{PREFIXES['dcterms']}references")))
    assert references == {model, image, iri("hall-1-1/_config/goals.yaml")}
    assert graph.value(iri("hall-1-1/"), VAST.n_goals).value == 2
    assert (iri("hall-1-1/0"), PROV.used, image) in graph
    assert (iri("hall-1-1/artefact_generation/"), PROV.used, iri("hall-1-1/plan.json")) in graph


def test_what_all_configurations_contribute_is_written_once(described: Path) -> None:
    generators = [n for n in nodes_of(described) if n["@id"] == "https://example.org/generator"]
    assert len(generators) == 1


GUIDE_HOOK = """\
from robovast.common.variation import Variation, ProvContribution


class Plans(Variation):
    @classmethod
    def collect_prov_metadata(
        cls, config_entry, described_namespace, config_namespace, gen_activity_id, vast_id
    ):
        from rdflib import PROV, Namespace

        MY_NS = Namespace("https://example.org/metamodels/")
        file_iri = config_namespace[config_entry.get("config", {})["plan"]]
        assert config_entry["_path"] == [[0.0, 1.0]]
        return ProvContribution(
            graph_nodes=[{
                "@id": file_iri,
                "@type": PROV["Entity"],
                "wasGeneratedBy": gen_activity_id,
                MY_NS["someProperty"]: "value",
            }],
            scenario_properties={MY_NS["outputCount"]: 1},
            run_used_iris=[file_iri],
        )
"""


def test_the_hook_of_the_guide_works(campaign: Path) -> None:
    (campaign / "_config/plans.py").write_text(GUIDE_HOOK)
    describe(campaign)
    graph = load(campaign)
    made = iri("hall-1-1/hall.fpm")
    own = rdflib.Namespace("https://example.org/metamodels/")
    assert graph.value(made, own.someProperty) == Literal("value")
    assert (made, PROV.wasGeneratedBy, iri("config_generation")) in graph
    assert (iri("hall-1-1/0"), PROV.used, made) in graph
    assert graph.value(iri("hall-1-1/"), own.outputCount).value == 1
    assert violations(graph) == ""


BAD_HOOKS = {
    "raises": ("raise OSError('gone')", "OSError: gone"),
    "returns nonsense": ("return {'a': 1}", "it returned a dict, not a ProvContribution or None"),
    "a node that is none": (
        "return ProvContribution(graph_nodes=['x'])",
        "a graph node must be a dict, not 'x'",
    ),
    "an IRI that is none": (
        "return ProvContribution(run_used_iris=[3])",
        "an IRI must be text, not 3",
    ),
    "a value that is none": (
        "return ProvContribution(scenario_properties={'n': object()})",
        "object cannot be written as YAML or JSON",
    ),
    "no lists at all": ("return ProvContribution(graph_nodes=None)", "TypeError"),
}


@pytest.mark.parametrize(("body", "cause"), BAD_HOOKS.values(), ids=BAD_HOOKS)
def test_a_bad_hook_is_named_and_the_rest_written(tmp_path: Path, body: str, cause: str) -> None:
    root = make_old_campaign(tmp_path)
    (root / "_config/plans.py").write_text(
        "from robovast.common.variation import ProvContribution, Variation\n\n\n"
        "class Plans(Variation):\n    @classmethod\n"
        f"    def collect_prov_metadata(cls, entry, c, d, e, f):\n        {body}\n"
    )
    write_metadata(root)
    with pytest.raises(PluginFaultsError) as caught:
        write_graph(root)
    (fault,) = caught.value.faults
    assert fault.startswith("plans.py:Plans.collect_prov_metadata: ")
    assert cause in fault
    assert (iri("hall-1-2/1"), RDF.type, VAST.TestExecution) in load(root)


def test_a_campaign_without_anything_has_a_graph(tmp_path: Path) -> None:
    root = tmp_path / "empty-2026-01-01-000000"
    (root / "_execution").mkdir(parents=True)
    describe(root)
    assert violations(load(root)) == ""


def test_names_with_blanks_and_other_signs_are_iris(tmp_path: Path) -> None:
    root = make_old_campaign(tmp_path, 1, 1, name="my tests: 100%-2026-03-04-152130")
    for name in ("a b.log", "50%.csv", "a:b.csv", "größe.csv", "c{d}.csv", "q?x#y.csv"):
        (root / "hall-1-1/0" / name).write_text("")
    describe(root)
    graph = load(root)
    base = f"{DATASET}my%20tests:%20100%25-2026-03-04-152130/hall-1-1/0"
    run = URIRef(base)
    names = {
        str(file).removeprefix(f"{base}/") for file in graph.subjects(PROV.wasGeneratedBy, run)
    }
    assert {
        "a%20b.log", "50%25.csv", "a:b.csv", "größe.csv", "c%7Bd%7D.csv", "q%3Fx%23y.csv"
    } <= names  # fmt: skip
    assert violations(graph) == ""


def test_what_a_pack_of_runs_wrote_is_its_jobs(tmp_path: Path) -> None:
    root = make_old_campaign(tmp_path, 1, 2)
    link = root / "hall-1-1/1/job"
    link.unlink()
    link.symlink_to("../../_jobs/job-0")
    describe(root)
    graph = load(root)
    job = iri("_jobs/job-0/")
    assert graph.value(iri("_jobs/job-0/logs/system.log"), PROV.wasGeneratedBy) == job
    assert set(graph.subjects(VAST.job, job)) == {iri("hall-1-1/0"), iri("hall-1-1/1")}
    assert violations(graph) == ""


def test_the_same_variation_twice_is_two_activities(tmp_path: Path) -> None:
    root = make_old_campaign(tmp_path, 1, 1)
    path = root / "_transient/configurations.yaml"
    path.write_text(path.read_text().replace("plans.py:Plans", "ParameterVariationList"))
    describe(root)
    graph = load(root)
    listed = rdflib.collection.Collection(graph, graph.value(iri("hall-1-1/"), VAST.variations))
    assert list(listed) == [
        iri("hall-1-1/variations/ParameterVariationList"),
        iri("hall-1-1/variations/ParameterVariationList-2"),
    ]
    assert violations(graph) == ""


def test_what_was_varied_is_in_the_graph(campaign: Path) -> None:
    path = campaign / "_transient" / "configurations.yaml"
    listed = parse_yaml(path.read_text())
    factors = {"clutter": {"value": 0.25, "unit": "1/m"}, "poses": {"value": [1]}}
    listed["configs"][0]["_factors"] = factors
    path.write_text(dump_yaml(listed))
    describe(campaign)
    graph = load(campaign)
    found = {
        (str(graph.value(node, vocabulary.name)), str(graph.value(node, vocabulary.value)))
        for vocabulary in [rdflib.Namespace(ROBOVAST)]
        for node in graph.objects(iri("hall-1-1/"), vocabulary.factor)
    }
    assert found == {("clutter", "0.25"), ("poses", "[1]")}
    assert violations(graph) == ""
    metadata = parse_yaml((campaign / "metadata.yaml").read_text())
    assert metadata["configurations"][0]["factors"] == factors


def test_links_that_lead_nowhere_are_no_files(tmp_path: Path) -> None:
    (tmp_path / "a.csv").touch()
    (tmp_path / "linked.csv").symlink_to("a.csv")
    for name, target in {"self": "self", "gone": "missing", "long": "x" * 300}.items():
        (tmp_path / name).symlink_to(target)
    assert list(list_files(str(tmp_path), "")) == ["a.csv", "linked.csv"]
