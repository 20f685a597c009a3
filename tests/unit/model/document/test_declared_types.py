"""Parameters have the types that the scenario declares; a `string` keeps the text of the file."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.campaigns.finished import finished_campaign

from robovast.analysis.tables.columnar import update_columnar
from robovast.analysis.tables.query import ask
from robovast.base.errors import DocumentError
from robovast.base.serialization import dump_yaml
from robovast.base.yaml_files import parse_yaml
from robovast.campaign.layout import SCENARIO_CONFIG, Layout
from robovast.campaign.verdict import Verdict
from robovast.evaluation.columns import columns
from robovast.evaluation.server.answers import Data
from robovast.evaluation.stored_runs import read_parameters
from robovast.evaluation.summaries import RunSummary, VariantRuns
from robovast.execution.generate import write_configurations
from robovast.model.document import load_document
from robovast.model.document.loader import Document, check_source
from robovast.model.document.search.template import entry_of
from robovast.model.document.source import Source
from robovast.model.expansion import compose

CASES = Path(__file__).parents[3] / "data/cases"
SCENARIO = """\
struct label:
    text: string
    size: int

scenario typed:
    rate: float = 0.1
    n: int = 1
    fast: bool = true
    name: string = "a"
    when: string = "b"
    names: list of string
    tag: label
    length_of_way: length = 1.0m
    do serial:
        log("hi")
"""
PLAIN = [
    *("12:30", "1.10", "no", "007", "~", "2024-01-01", "0x1A", "1_000", "=", "<<", "1e3", "null"),
    *(
        "2024-99-99",
        "1" * 5000,
        "0b11",
        "0o17",
        ".5",
        "+5",
        ".inf",
        ".nan",
        "true",
        "Off",
        "y",
        "-0",
    ),
    *("2001-12-14t21:59:43.10-05:00", "190:20:30", "1.e5", "5e10293", "1_1", "NULL", "010"),
]
LOOKS = re.compile(r"[0-9][0-9_.:eExX+-]{0,8}[0-9]")
FORMS = st.one_of(st.sampled_from(PLAIN), st.from_regex(LOOKS, fullmatch=True))


def in_quotes(text: str) -> str:
    return str(yaml.dump(text, default_style='"', width=10**9)).strip()


def load(folder: Path, text: str) -> Document:
    (folder / "s.osc").write_text(SCENARIO)
    head = "version: 1\nmetadata: {name: y}\nexecution: {scenario_file: s.osc, runs: 1}\n"
    return check_source(Source(folder / "y.vast", head + text))


def values(document: Document, folder: Path) -> list[dict[str, Any]]:
    return [dict(variant.parameters) for variant in compose(document, folder).variants]


@pytest.mark.parametrize("spelt", PLAIN)
@pytest.mark.parametrize(
    ("form", "expected"),
    [
        ("parameters: [name: {}]", [{"name": "{}"}]),
        ("variations: [ParameterVariationList: {{name: name, values: [{}, a]}}]", [{"name": "{}"}]),
        (
            "variations: [ParameterVariationList: {{name: [n, name], values: [[2, {}]]}}]",
            [{"n": 2, "name": "{}"}],
        ),
        (
            "variations: [OneOfVariation: {{variations: [ParameterVariationList: "
            "{{name: name, values: [{}]}}]}}]",
            [{"name": "{}"}],
        ),
        ("parameters: [names: [{}, b]]", [{"names": ["{}", "b"]}]),
        ("parameters: [tag: {{text: {}, size: 3}}]", [{"tag": {"text": "{}", "size": 3}}]),
    ],
)
def test_text_keeps_its_spelling(
    tmp_path: Path, form: str, expected: list[dict[str, Any]], spelt: str
) -> None:
    document = load(tmp_path, f"configuration:\n- name: a\n  {form.format(spelt)}\n")
    found = values(document, tmp_path)
    wanted = json.loads(json.dumps(expected).replace("{}", spelt))
    assert found[: len(wanted)] == wanted


@pytest.mark.parametrize("spelt", ["12:30", "1.10", "no", "007", "~", "2024-01-01"])
def test_choices_of_a_search_keep_their_spelling(tmp_path: Path, spelt: str) -> None:
    document = load(
        tmp_path,
        "search:\n  strategy: random\n  objectives: [{name: failure_rate}]\n"
        "  budget: [{batches: 1}]\n  parameters: [when: $time]\n  search_space:\n"
        f"    time: {{type: choice, values: [{spelt}, b]}}\n"
        f"    name: {{type: choice, values: [{spelt}, c]}}\n",
    )
    assert document.vast.search is not None
    space = document.vast.search.search_space
    assert (space["time"].values, space["name"].values) == ([spelt, "b"], [spelt, "c"])
    entry = entry_of(document.vast.search, {"time": spelt, "name": "c"})
    assert entry.parameters == [{"when": spelt}, {"name": "c"}]


@pytest.mark.parametrize(
    ("pair", "value"),
    [
        *(("rate: 1e-3", 0.001), ("rate: 5E-2", 0.05), ("rate: 1.0e3", 1000.0), ("rate: '7'", 7)),
        *(
            ("rate: -1e5", -1e5),
            ("length_of_way: 1e-3", 0.001),
            ("n: '12'", 12),
            ("fast: 'no'", False),
        ),
        *(("n: 1000", 1000), ("rate: 1.10", 1.1), ("fast: yes", True)),
    ],
)
def test_text_is_a_number_where_one_is_declared(tmp_path: Path, pair: str, value: Any) -> None:
    document = load(tmp_path, f"configuration:\n- name: a\n  parameters: [{pair}]\n")
    (found,) = values(document, tmp_path)
    assert list(found.values()) == [value]
    assert type(next(iter(found.values()))) is type(value)


@pytest.mark.parametrize("pair", ["rate: 1e-3x", "rate: e5", "rate: '.'", "n: 1e3", "fast: 2"])
def test_a_value_of_another_type_is_an_error_with_its_place(tmp_path: Path, pair: str) -> None:
    with pytest.raises(DocumentError, match=r"(?s)y\.vast:6:.* must be .*s\.osc:\d+ declares"):
        load(tmp_path, f"configuration:\n- name: a\n  parameters: [{pair}]\n")


@given(
    st.sampled_from(["rate", "n", "length_of_way"]),
    st.from_regex(r"[-+]?0[0-9]{1,3}", fullmatch=True)
    | st.from_regex(r"[1-9][0-9]?(:[0-5][0-9]){1,2}", fullmatch=True)
    | st.sampled_from(["1e400", "1.0e+400", "-1.0e+999", "1:30.5", "0o17", "'010'"]),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_a_number_that_yaml_reads_otherwise_than_people_is_refused(
    tmp_path: Path, name: str, spelt: str
) -> None:
    with pytest.raises(DocumentError, match=r"must be .*number in decimal digits, such as `10`"):
        load(tmp_path, f"configuration:\n- name: a\n  parameters: [{name}: {spelt}]\n")


@given(st.integers(0, 2**70), st.sampled_from(["{:_}", "{:#x}", "{:#b}", "{}"]))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_a_number_that_yaml_and_people_read_alike_is_read(
    tmp_path: Path, number: int, form: str
) -> None:
    spelt = form.format(number)
    document = load(tmp_path, f"configuration:\n- name: a\n  parameters: [n: {spelt}]\n")
    assert values(document, tmp_path) == [{"n": number}]


@pytest.mark.parametrize("spelt", ["0", "-0", "+5", "00.5", ".5", "5.", ".inf", "-.INF", "1e300"])
def test_decimal_numbers_are_read(tmp_path: Path, spelt: str) -> None:
    document = load(tmp_path, f"configuration:\n- name: a\n  parameters: [rate: {spelt}]\n")
    number = float(spelt.lower().replace(".inf", "inf"))
    assert values(document, tmp_path) == [{"rate": number}]


def test_an_impossible_date_is_an_error_where_no_text_is_declared(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="`2024-99-99` is an impossible date"):
        load(tmp_path, "configuration:\n- name: a\n  parameters: [rate: 2024-99-99]\n")


def test_a_merged_value_that_is_replaced_leaves_no_text(tmp_path: Path) -> None:
    document = load(
        tmp_path,
        "configuration:\n- name: a\n  parameters: [&x {name: 12:30}]\n"
        "- name: b\n  parameters: [{<<: *x, name: own}]\n- name: c\n  parameters: [*x]\n",
    )
    assert values(document, tmp_path) == [{"name": "12:30"}, {"name": "own"}, {"name": "12:30"}]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("yaml/sexa", [{"when": "12:30"}]),
        ("yaml/date", [{"name": text} for text in ("2026-01-01", "1.10", "007", "1e3")]),
        ("yaml/tilde", [{"name": "~"}]),
        ("yaml/expo", [{"rate": 0.001}]),
        ("yaml/expolist", [{"rate": number} for number in (0.001, 0.05, 1000.0)]),
        ("labels/lab", [{"cell": text} for text in ("1_1", "11", "007", "7", "5e10293")]),
    ],
)
def test_documents_of_the_cases(tmp_path: Path, name: str, expected: list[dict[str, Any]]) -> None:
    assert values(load_document(CASES / f"{name}.vast"), tmp_path) == expected


@given(st.lists(st.one_of(FORMS, st.text(max_size=12)), min_size=1, max_size=6, unique=True))
@settings(max_examples=8, deadline=None, suppress_health_check=list(HealthCheck))
def test_every_answer_has_the_text_of_the_file(tmp_path: Path, texts: list[str]) -> None:
    """From the .vast file to scenario.config, tables, query and the JSON of the web UI."""
    shutil.rmtree(tmp_path / "r", ignore_errors=True)
    written = [t if t in PLAIN or LOOKS.fullmatch(t) else in_quotes(t) for t in texts]
    listed = "".join(f"      - {text}\n" for text in written)
    document = load(
        tmp_path,
        "configuration:\n- name: c\n  variations:\n  - ParameterVariationList:\n"
        f"      name: name\n      values:\n{listed}",
    )
    (tmp_path / "y.vast").write_text("")
    campaign = finished_campaign(tmp_path / "r", len(texts), runs_per_variant=1)
    write_configurations(document, compose(document, tmp_path), campaign, timings=False)
    names = [f"c-{index + 1}" for index in range(len(texts))]
    for name, text in zip(names, texts, strict=True):
        config = parse_yaml((campaign / name / SCENARIO_CONFIG).read_bytes())
        assert config == {"typed": {"name": text}}
        path = campaign / name / "0/run.json"
        record = json.loads(path.read_text())
        path.write_text(json.dumps({**record, "parameters": config["typed"]}))
    update_columnar(Layout(campaign), {f"{name}/0": "1" for name in names})
    answer = ask([campaign], "SELECT config, param_name FROM runs")
    assert dict(answer.rows) == dict(zip(names, texts, strict=True))
    counted = ask([campaign], "SELECT param_name, count(*) FROM runs GROUP BY ALL").rows
    assert sorted(counted) == sorted((text, 1) for text in texts)
    run = RunSummary(0, Verdict.PASSED, "", None, None)
    read = [read_parameters(campaign.parent, campaign.name, name) for name in names]
    variants = [VariantRuns(n, "c", p, (run,)) for n, p in zip(names, read, strict=True)]
    shown = json.loads(bytes(Data(columns(variants)).body))
    assert shown["variants"]["values"]["name"] == texts


@given(st.one_of(FORMS, st.text(), st.lists(st.text()), st.dictionaries(st.text(), st.text())))
def test_yaml_gives_text_back(value: Any) -> None:
    assert parse_yaml(dump_yaml({"a": value})) == {"a": value}
