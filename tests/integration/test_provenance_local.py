"""A campaign that was really run has metadata and a graph that can be asked."""

from __future__ import annotations

from pathlib import Path

import yaml
from support.campaigns.local import make_campaign, run

from robovast.analysis.provenance import describe
from robovast.analysis.provenance.query import Graphs, read_query

SCRIPT = 'echo "$1" > "$3/value.csv"\n[ "$1" != 2 ]\n'


def test_a_local_campaign_can_be_asked(tmp_path: Path) -> None:
    document = make_campaign(tmp_path / "in", SCRIPT, extra="  runs: 2\n")
    campaign = run(document, tmp_path / "out").campaign
    describe(campaign)

    metadata = yaml.safe_load((campaign / "metadata.yaml").read_text())
    results = [r for entry in metadata["configurations"] for r in entry["test_results"]]
    verdicts = {result["dir"]: result["success"] for result in results}
    assert [path for path, success in verdicts.items() if success == "false"] == [
        "one-2/0", "one-2/1"
    ]  # fmt: skip
    assert all(result["sysinfo"]["platform"]["system"] == "Linux" for result in results)
    assert all(result["start_time"] < result["end_time"] for result in results)

    graphs = Graphs([campaign])
    rows = {
        name: [dict(zip(answer.columns, row, strict=True)) for row in answer]
        for name in ("vast-file", "scenario-generation", "test-results", "variation-types")
        for answer in [graphs.ask(read_query(name))]
    }
    (vast_file,) = rows["vast-file"]
    assert vast_file["vast_file"].endswith(f"/{campaign.name}/_config/test.vast")
    assert vast_file["abstract_scenario"].endswith("/_config/scenario.osc")
    assert vast_file["date"] is not None
    assert len(rows["scenario-generation"]) == 3
    kinds = {row["variation_type"].rpartition("/")[2] for row in rows["variation-types"]}
    assert kinds == {"ParameterVariationList"}
    written = {row["gen_file"].rpartition("/")[2] for row in rows["test-results"]}
    assert {"test.xml", "value.csv", "system.log", "sysinfo.yaml"} <= written
    failed = {row[0].partition(f"{campaign.name}/")[2] for row in graphs.ask(FAILED)}
    assert failed == {"one-2/0", "one-2/1"}


FAILED = "SELECT ?run { ?run robovast:success false }"
