"""A parameter that is declared as `string` keeps its spelling in notebooks, the graph and JUnit."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.campaigns.finished import add_run

from robovast.analysis.provenance.graph import factor_nodes
from robovast.base.serialization import dump_yaml
from robovast.base.yaml_files import parse_yaml
from robovast.campaign.junit import merged_suites, report_text
from robovast.campaign.layout import VARIANT_RECORD, Layout
from robovast.common.analysis import get_factors, get_scenario_parameter, read_output_files

TEXTS = ["007", "100000", "11", "12:30", "1_1", "1e5", "5e10293", "7", "no"]


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """A campaign with a configuration for each text, which is its name, parameter and factor."""
    root = tmp_path / "lab-2026-01-01-000000"
    for number, text in enumerate(TEXTS):
        folder = add_run(root, text, 0, number).parent
        (folder / "_config/scenario.config").write_text(dump_yaml({"s": {"cell": text}}))
        factors = {"cell": {"value": text}}
        (folder / VARIANT_RECORD).write_text(dump_yaml({"name": text, "factors": factors}))
    return root


def test_notebooks_get_each_text_as_it_is_written(campaign: Path) -> None:
    frame = read_output_files(campaign, lambda _: pd.DataFrame({"x": [1]}))
    assert frame["config"].tolist() == frame["cell"].tolist() == TEXTS
    for text in TEXTS:
        assert get_scenario_parameter(campaign / text, "cell") == text
        assert get_factors(campaign / text / "0") == {"cell": text}


def test_a_junit_report_names_each_configuration_as_it_is_written(campaign: Path) -> None:
    report = report_text("lab", merged_suites(Layout(campaign)))
    assert re.findall('<testsuite name="(.*?)"', report) == TEXTS
    assert re.findall('<testcase classname="(.*?)"', report) == TEXTS


@given(st.one_of(st.sampled_from(TEXTS), st.from_regex(r"[-+]?[0-9_.:eExX~]{1,8}", fullmatch=True)))
def test_the_graph_has_each_text_as_it_is_written(text: str) -> None:
    stored = parse_yaml(dump_yaml({"cell": {"value": text}}))
    (node,) = json.loads(json.dumps(factor_nodes(stored)))
    assert node["value"] == text
