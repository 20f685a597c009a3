"""Documents that the existing tool takes: what counts, and what is said to be ignored."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from robovast.base.errors import DocumentError
from robovast.base.serialization import dump_yaml
from robovast.model.document import load_document
from robovast.model.document.files import match_run_files
from robovast.model.document.loader import Document
from robovast.model.expansion import expand

SCENARIO = """\
scenario drive:
    speed: float = 1.0
    label: string = "a"
    do serial:
        log(label)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "a.osc").write_text(SCENARIO)
    return tmp_path


def load(folder: Path, text: str) -> Document:
    path = folder / "a.vast"
    path.write_text(f"version: 1\n{text}")
    return load_document(path)


def execution(text: str) -> str:
    return f"execution:\n  scenario_file: a.osc\n{text}"


def test_variations_start_from_the_parameters_of_their_entry(folder: Path) -> None:
    entry = (
        "configuration:\n- name: t\n  parameters: [{label: k, speed: 9.0}]\n"
        "  variations: [{ParameterVariationList: {name: speed, values: [1.0, 2.0]}}]\n"
    )
    variants = expand(load(folder, entry + execution("")), folder)
    assert [(v.name, v.parameters) for v in variants] == [
        ("t-1", {"label": "k", "speed": 1.0}),
        ("t-2", {"label": "k", "speed": 2.0}),
    ]


def test_one_item_may_hold_several_pairs(folder: Path) -> None:
    text = "configuration: [{name: t, parameters: [{label: k, speed: 2.0}]}]\n" + execution(
        "  env: [{A: 1, B: x}]\n  resources: {cpu: [{lab: 2, here: 4}]}\n"
    )
    document = load(folder, text)
    assert expand(document, folder)[0].parameters == {"label": "k", "speed": 2.0}
    assert document.vast.execution.env == [{"A": "1"}, {"B": "x"}]
    assert not document.warnings


SPELLINGS = st.one_of(
    st.sampled_from(["no", "True", "12:30", "007", "1_000", "2024-13-45", "1.10", ".inf", "0x1F"]),
    st.from_regex(r"[-+]?[0-9]{1,12}(\.[0-9]{0,6}|[_:][0-9]{1,2}|e[0-9]{1,4})?", fullmatch=True),
)


@given(SPELLINGS)
def test_environment_and_metadata_keep_the_spelling(spelling: str) -> None:
    text = f"metadata: {{build: {spelling}, tags: [{spelling}]}}\n" + execution(
        f"  env: [{{BUILD: {spelling}}}]\n"
    )
    with TemporaryDirectory() as folder:
        (Path(folder) / "a.osc").write_text(SCENARIO)
        vast = load(Path(folder), text).vast
    assert vast.execution.env == [{"BUILD": spelling}]
    written = yaml.safe_load(dump_yaml(vast.metadata))
    assert str(written["build"]) == str(written["tags"][0]) == spelling


@pytest.mark.parametrize(
    "text",
    [
        execution("  env:\n  run_files:\n  resources:\n  secondary_containers:\n  local:\n"),
        execution("") + "results_processing:\nevaluation:\nanalysis:\nmetadata:\ngeneral:\n",
        execution("") + "results_processing: {postprocessing: , publication: }\n",
        execution("") + "evaluation: {visualization: }\n",
        execution("") + "evaluation: {visualization: [null, {a: null}, {b: {run: null}}]}\n",
    ],
)
def test_a_section_may_be_empty(folder: Path, text: str) -> None:
    document = load(folder, text)
    assert document.vast.execution.env == []
    assert document.vast.postprocessing == []
    assert not document.warnings


def test_what_variation_types_share_is_general(folder: Path) -> None:
    (folder / "own.py").write_text(
        "from robovast.common.variation import Variation\n"
        "class Own(Variation):\n"
        "    def variation(self, in_configs):\n"
        "        label = self.general_parameters.get('label', 'none')\n"
        "        return [self.update_config(c, {'label': label}) for c in in_configs]\n"
    )
    entry = "configuration: [{name: t, variations: ['own.py:Own']}]\n" + execution("")
    assert expand(load(folder, entry), folder)[0].parameters == {"label": "none"}
    given = load(folder, "general: {label: x}\n" + entry)
    assert expand(given, folder)[0].parameters == {"label": "x"}


@pytest.mark.parametrize(
    "item", ["{nav: {resources: {cpu: 3}}}", "{nav: null, resources: {cpu: 3}}",
             "{resources: {cpu: 3}, nav: }"]
)  # fmt: skip
def test_limits_of_a_secondary_container_may_stand_beside_its_name(folder: Path, item: str) -> None:
    document = load(folder, execution(f"  secondary_containers: [{item}]\n"))
    (container,) = document.vast.execution.secondary_containers
    assert (container.name, container.resources.cpu) == ("nav", 3)


@pytest.mark.parametrize(
    ("text", "warning"),
    [
        (execution("  colour: red\n"), "4:3: execution.colour: the key `colour` is not known"),
        (
            "configuration: [{name: t, group: {a: 1}}]\n" + execution(""),
            "2:27: configuration[0].group: the key `group` is not known and has no effect",
        ),
        (
            execution("") + "evaluation: {visualization: [{a: {title: x}}]}\n",
            "evaluation.visualization[0].a.title: the key `title` is not known",
        ),
        (execution("  env: [{OUTPUT_DIR: x}]\n"), "`OUTPUT_DIR` is set by RoboVAST"),
        (execution("") + "---\nversion: 2\n", "only the first YAML document counts"),
        (execution("  run_files: ['*.none']\n"), "`*.none` matches no file in"),
        (
            execution("") + "evaluation: {visualization: [null, {a: {run: nb/a.ipynb}}]}\n",
            "evaluation.visualization[1].a.run: there is no notebook `nb/a.ipynb` in",
        ),
    ],
)
def test_what_has_no_effect_is_told_with_its_place(folder: Path, text: str, warning: str) -> None:
    document = load(folder, text)
    (told,) = map(str, document.warnings)
    assert warning in told
    assert document.vast.execution.env == []


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("colour: red\n" + execution(""), "unknown key `colour`"),
        (execution("  run_file: [a]\n"), "unknown key `run_file`\n    Did you mean `run_files`?"),
        (execution("  env: [{CAMPAIGN_ID: x}]\n"), "`CAMPAIGN_ID` is set by RoboVAST"),
        (
            "configuration: [{name: t, parameters: [{spead: 1}]}]\n" + execution(""),
            "has no parameter `spead`",
        ),
        (
            "configuration:\n- name: t\n  variations:\n  - ParameterVariationList:\n"
            "    name: speed\n    values: [1.0]\n" + execution(""),
            ":5:5: configuration[0].variations[0]: the parameters of `ParameterVariationList` must "
            "be indented further than its name",
        ),
    ],
)
def test_what_was_meant_otherwise_stays_an_error(folder: Path, text: str, problem: str) -> None:
    with pytest.raises(DocumentError) as error:
        load(folder, text)
    assert problem in str(error.value)


FILES = ["top.py", "files/x.py", "files/a/y.py", "files/a/b/z.sdf"]


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("files/*", "xyz"),
        ("**/files/*", "xyz"),
        ("files/", "xyz"),
        ("*.py", "txy"),
        ("files/*.py", "xy"),
        ("**/a/*", "yz"),
        ("files/**", "xyz"),
        ("files/x.py", "x"),
        ("nothing", ""),
        ("../*", ""),
    ],
)
def test_patterns_take_what_is_below(tmp_path: Path, pattern: str, names: str) -> None:
    hidden = [".git/h.py", "files/.h.py", "nav-2026-01-01-000000/_config/top.py"]
    for name in [*FILES, *hidden, "files/__pycache__/x.py"]:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    found = match_run_files(tmp_path, pattern)
    assert sorted(path.name[0] for path in found) == sorted(names)


def test_a_hidden_file_is_taken_where_it_is_named(tmp_path: Path) -> None:
    (tmp_path / ".rviz").write_text("")
    assert match_run_files(tmp_path, ".rviz") == [Path(".rviz")]


def test_without_configurations_there_is_one_of_the_scenarios_defaults(folder: Path) -> None:
    document = load(folder, execution(""))
    assert [(v.name, v.parameters) for v in expand(document, folder)] == [("config1", {})]


@pytest.mark.parametrize("sign", ["merged/_transient", "prepared/out_template"])
def test_campaigns_in_folders_with_names_of_their_own_hold_no_inputs(
    folder: Path, sign: str
) -> None:
    (folder / sign).mkdir(parents=True)
    for copy in (folder / sign / "drive.py", folder / Path(sign).parts[0] / "jobs" / "drive.py"):
        copy.parent.mkdir(exist_ok=True)
        copy.touch()
    (folder / "drive.py").touch()
    for pattern in ("*.py", "**/*.py", "merged/**", "prepared/jobs/drive.py"):
        assert set(match_run_files(folder, pattern)) <= {Path("drive.py")}


def test_a_documents_own_folder_may_be_named_as_a_campaign_is(tmp_path: Path) -> None:
    folder = tmp_path / "camp-2026-01-01-000000"
    (folder / "_transient").mkdir(parents=True)
    (folder / "drive.py").touch()
    assert match_run_files(folder, "*.py") == [Path("drive.py")]
