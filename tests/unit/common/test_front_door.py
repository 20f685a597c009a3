"""`import robovast`: small, complete, and what it opens."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import pytest
from support.campaigns.finished import as_of_another_tool, finished_campaign

import robovast

HEAVY = ("typing", "pydantic", "yaml", "rich", "typer", "duckdb", "rdflib", "robovast.model")


def test_importing_it_imports_next_to_nothing() -> None:
    code = f"import robovast, sys; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_each_name_is_there_and_explained() -> None:
    for name in robovast.__all__:
        assert name == "__version__" or inspect.getdoc(getattr(robovast, name)), name
    assert dir(robovast) == sorted(robovast.__all__)
    with pytest.raises(AttributeError, match="no attribute 'lode_document'"):
        _ = robovast.lode_document  # type: ignore[attr-defined]


def test_a_campaign_is_opened_with_its_runs(tmp_path: Path) -> None:
    folder = finished_campaign(tmp_path, 3)
    campaign = robovast.open_campaign(str(folder))
    assert [variant.name for variant in campaign.variants()] == ["c-1", "c-2"]
    runs = [(run.variant, run.number, run.verdict, run.duration) for run in campaign.runs()]
    passed = robovast.Verdict.PASSED
    assert runs == [("c-1", 0, passed, 2.0), ("c-1", 1, passed, 2.0), ("c-2", 0, passed, 2.0)]
    assert campaign.runs()[2].parameters == {"x": 2, "text": "a, b"}
    assert (campaign.runs()[2].folder / "out.csv").read_text() == "v\n2\n"


def test_so_is_one_of_another_tool(tmp_path: Path) -> None:
    folder = finished_campaign(tmp_path, 3)
    as_of_another_tool(folder)
    (*_, last) = robovast.open_campaign(folder).runs()
    assert (last.verdict, last.duration, last.parameters) == ("passed", 1.5, {"x": 2})
    (folder / "_transient" / "configurations.yaml").unlink()
    (*_, last) = robovast.open_campaign(folder).runs()
    assert (last.verdict, last.parameters) == ("passed", {})


def test_what_is_no_campaign_is_refused(tmp_path: Path) -> None:
    with pytest.raises(robovast.RobovastError, match="contains no campaign"):
        robovast.open_campaign(tmp_path)
    finished_campaign(tmp_path, 1)
    with pytest.raises(robovast.RobovastError, match="Open one of them, for example camp-2026"):
        robovast.open_campaign(tmp_path)


def test_tables_are_made_and_asked(tmp_path: Path) -> None:
    campaign = robovast.open_campaign(finished_campaign(tmp_path, 3))
    with pytest.raises(robovast.RobovastError, match="no tables to query"):
        campaign.query("SELECT 1 FROM runs")
    assert not campaign.postprocess().failures
    answer = campaign.query("SELECT config, count(*) AS runs FROM runs GROUP BY ALL ORDER BY ALL")
    assert (answer.columns, answer.rows) == (["config", "runs"], [("c-1", 2), ("c-2", 1)])
    assert robovast.ask([campaign.folder], "SELECT max(v) FROM out").rows == [(2,)]
