"""The guide's floor-plan queries on the provenance graph of a generated campaign."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest
from rdflib import DCTERMS, Namespace

from robovast.campaign.layout import Layout
from robovast.execution.generate import write_configurations, write_execution
from robovast.model.document import load_document
from robovast.model.expansion import compose
from robovast.navigation.floorplan_variation import FloorplanGeneration
from robovast_cli.main import command

EXAMPLE = Path(__file__).parents[3] / "configs" / "examples" / "floor_plans" / "floor_plans.vast"
VERDICT = """\
<testsuites><testsuite name="drive" errors="0" failures="{failures}" tests="1" time="1.0">
<properties><property name="start_time" value="1700000000.0"/></properties>
<testcase name="drive" time="1.0"/></testsuite></testsuites>
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example as if it had run: of each three runs the first fails."""
    root = tmp_path_factory.mktemp("results") / "floor-plans-2026-03-04-152130"
    document = load_document(EXAMPLE)
    composition = compose(document, tmp_path_factory.mktemp("work"))
    write_configurations(document, composition, root, timings=True)
    layout = Layout(root)
    started = datetime(2026, 3, 4, 15, 21, 30, tzinfo=UTC)
    write_execution(
        layout, document, started=started, runs=1, seed=5, kind="local", image="", image_revision=""
    )
    for index, variant in enumerate(composition.variants):
        run = root / variant.name / "0"
        run.mkdir(parents=True)
        (run / "test.xml").write_text(VERDICT.format(failures=int(index % 3 == 0)))
    with pytest.raises(SystemExit) as caught:
        command().main(["results", "metadata", "-r", str(root)])
    assert not caught.value.code
    return root


@pytest.fixture
def ask(campaign: Path, capsys: pytest.CaptureFixture[str]):
    def run(query: str) -> list[dict[str, str]]:
        capsys.readouterr()
        with pytest.raises(SystemExit):
            command().main(["results", "sparql", query, "-r", str(campaign), "-o", "json"])
        rows: list[dict[str, str]] = json.loads(capsys.readouterr().out)
        return rows

    return run


def names(rows: list[dict[str, str]], column: str) -> set[str]:
    """What a column names, without the folder of its campaign."""
    return {row[column].rpartition("152130/")[2] for row in rows}


def test_every_floor_plan_is_a_model_with_its_author(ask) -> None:
    rows = ask("floorplan-models")
    models = names(rows, "floorplan")
    assert {"_config/plans/hall.fpm", "_config/plans/office.fpm"} < models
    assert len({model for model in models if model.startswith("_transient/fpm/")}) == 3
    assert names(rows, "creator") == {"agents/The-RoboVAST-developers"}
    assert all(row["date"] for row in rows)


def test_models_are_transformed_and_artefacts_generated(ask) -> None:
    transformed = ask("floorplan-transformation")
    assert len(transformed) == 12 * 3  # configurations × files of the graph
    assert all(row["agent"] for row in transformed)
    config = "buildings-1-1/_config"
    generated = names(ask("floorplan-generation"), "gen_file")
    assert {
        f"{config}/maps/hall.yaml",
        f"{config}/maps/hall.pgm",
        f"{config}/3d-mesh/hall.stl",
    } < generated


def test_failures_are_counted_by_environment(ask) -> None:
    rows = ask("failure-rate")
    found = {
        row["env_model"].rpartition("152130/")[2]: (row["result"], row["total"]) for row in rows
    }
    assert found.pop("_config/plans/hall.fpm") == (pytest.approx(100 / 3), 3)
    assert found.pop("_config/plans/office.fpm") == (pytest.approx(100 / 3), 3)
    assert sorted(found.values()) == [(0.0, 2), (50.0, 2), (50.0, 2)]  # of each drawn plan


def test_scenarios_say_how_much_is_in_them(ask, tmp_path: Path) -> None:
    query = tmp_path / "counts.rq"
    query.write_text(
        "SELECT ?goals (COUNT(?obstacles) AS ?with) WHERE { ?c robovast:n_goals ?goals ."
        " OPTIONAL {?c robovast:n_obstacles ?obstacles} } GROUP BY ?goals"
    )
    assert ask(str(query)) == [{"goals": 1, "with": 6}]


def test_a_drawn_plan_is_derived_from_its_base(ask, tmp_path: Path) -> None:
    query = tmp_path / "bases.rq"
    query.write_text(
        "SELECT ?base ?drawn WHERE { ?drawn a env:FloorPlanModel ; prov:wasDerivedFrom ?base }"
    )
    rows = ask(str(query))
    assert len(rows) == 3
    assert names(rows, "base") == {"_config/plans/office.fpm"}


def test_a_generator_in_a_container_is_named_with_its_digest() -> None:
    namespace = Namespace("https://example.org/c/")
    record = {
        **{key: f"floorplans/a/{key}" for key in ("map_file", "image", "mesh_file")},
        "model": "_config/a.fpm",
        "graph": [],
        "resolution": 0.05,
        "modified": "2026-01-02",
        "creators": [],
        "contributors": [],
        "generator": {"image": "my/generator:1", "digest": "sha256:12"},
    }
    entry = {"navigation": {"floorplan": record}}
    found = FloorplanGeneration.collect_prov_metadata(entry, namespace, namespace, "g", "v")
    assert found is not None
    (generator,) = [node for node in found.graph_nodes if DCTERMS.hasVersion in node]
    assert generator["@id"].endswith("/my/generator:1")
    assert generator[DCTERMS.hasVersion] == "sha256:12"
