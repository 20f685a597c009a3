"""A merged report counts the cases of each tool as the tool does."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.base.xml_files import parse_xml
from robovast.campaign.junit import merged_suites, report_text
from robovast.campaign.layout import Layout
from robovast.campaign.verdict import Verdict, read_test_result

CASES = Path(__file__).parents[2] / "data/cases/junit"
NOT_RUN = ("notrun", "skipped", "disabled", "untested", "suppressed", "ignored", "Pending")
RAN = ("run", "completed", "passed", "")
BAD = ("failed", "error", "broken")


def merged(folder: Path, text: str) -> ET.Element:
    run = folder / "hall" / "0"
    run.mkdir(parents=True, exist_ok=True)
    (run / "test.xml").write_text(text)
    return parse_xml(report_text("all", merged_suites(Layout(folder))).encode())


def outcome(case: ET.Element) -> str:
    return next((child.tag for child in case), "passed")


@given(
    states=st.lists(st.sampled_from((*NOT_RUN, *RAN)), min_size=1, max_size=5),
    key=st.sampled_from(("status", "result", "Status")),
)
def test_cases_that_did_not_run_are_skipped(tmp_path_factory, states, key) -> None:
    cases = "".join(f'<testcase name="c{i}" {key}="{s}"/>' for i, s in enumerate(["run", *states]))
    text = f'<testsuites><testsuite name="a">{cases}</testsuite></testsuites>'
    report = merged(tmp_path_factory.mktemp("campaign"), text)
    right = ["skipped" if state in NOT_RUN else "passed" for state in states]
    assert [outcome(case) for case in report.iter("testcase")] == ["passed", *right]
    assert {element.get("skipped") for element in (report, report[0])} == {
        str(right.count("skipped"))
    }


def test_suites_may_be_nested_deeply(tmp_path: Path) -> None:
    inner = '<testcase name="c"/><testcase name="d"><skipped/></testcase>'
    text = "<testsuite>" * 5000 + inner + "</testsuite>" * 5000
    report = merged(tmp_path, f"<testsuites>{text}</testsuites>")
    assert [outcome(case) for case in report.iter("testcase")] == ["passed", "skipped"]


@pytest.mark.parametrize("state", BAD)
def test_a_case_whose_state_is_bad_failed(tmp_path: Path, state: str) -> None:
    text = (
        f'<testsuite name="a"><testcase name="c"/><testcase name="d" status="{state}"/></testsuite>'
    )
    report = merged(tmp_path, text)
    assert [outcome(case) for case in report.iter("testcase")] == ["passed", "failure"]


@pytest.mark.parametrize(
    ("child", "right"),
    [
        *(("flakyFailure", "failure"), ("rerunError", "error"), ("disabled", "skipped")),
        *(("ignored", "skipped"), ("system-out", "passed")),
    ],
)
def test_child_elements_of_all_tools_count(tmp_path: Path, child: str, right: str) -> None:
    cases = f'<testcase name="c"/><testcase name="d"><{child}/></testcase>'
    text = f'<testsuite name="a">{cases}</testsuite>'
    assert outcome(list(merged(tmp_path, text).iter("testcase"))[1]) == right


def test_all_cases_of_a_skipped_suite_are_skipped(tmp_path: Path) -> None:
    text = (
        '<testsuites><testsuite name="a"><testcase name="c"/></testsuite>'
        '<testsuite name="b" status="skipped"><testsuite name="in"><testcase name="d"/></testsuite>'
        "</testsuite></testsuites>"
    )
    report = merged(tmp_path, text)
    assert [outcome(case) for case in report.iter("testcase")] == ["passed", "skipped"]


@pytest.mark.parametrize("name", [path.name for path in sorted(CASES.iterdir()) if path.is_dir()])
def test_no_report_of_a_tool_loses_its_verdict(tmp_path: Path, name: str) -> None:
    """Whatever the tool writes, the merged report is bad exactly if the run is."""
    run = tmp_path / "hall" / "0"
    run.mkdir(parents=True)
    (run / "test.xml").write_bytes((CASES / name / "0" / "test.xml").read_bytes())
    report = parse_xml(report_text("all", merged_suites(Layout(tmp_path))).encode())
    bad = report.get("failures") != "0" or report.get("errors") != "0"
    assert bad == (read_test_result(run).verdict is not Verdict.PASSED)


def test_disabled_cases_of_googletest_are_skipped(tmp_path: Path) -> None:
    report = merged(tmp_path, (CASES / "gtest/0/test.xml").read_text())
    assert [outcome(case) for case in report.iter("testcase")] == ["passed", "skipped", "skipped"]
    assert report.get("skipped") == "2"
