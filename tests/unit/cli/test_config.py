"""`vast config`: lists, descriptions, generated folders, exported and imported entries."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from robovast.base.errors import InputError
from robovast_cli.commands.config.entries import append_entries

TABLE = """\
NAME       speed  goal
sweep-1-1  0.5    door
sweep-1-2  0.5    ramp, left
sweep-2-1  1.0    door
sweep-2-2  1.0    ramp, left
sweep-3-1  2.0    door
sweep-3-2  2.0    ramp, left
fixed      0.1

7 configurations, 2 runs each: 14 in total
"""


def test_list_is_a_table(vast, sweep) -> None:
    assert vast("config", "list").out == TABLE


def test_different_values_are_different_in_the_table(vast, sweep) -> None:
    own = sweep.read_text().replace("speed: 0.1 ", "goal: VALUE ")
    shown = {}
    for value in ("a", "'a '", "''", "' '", "'12'", "'[\"1\", 2]'", "'true'", "'\"a\"'"):
        sweep.write_text(own.replace("VALUE", value))
        shown[value] = vast("config", "list").out
    assert len(set(shown.values())) == len(shown)
    assert '"12"' in shown["'12'"]


def test_list_formats_agree(vast, sweep) -> None:
    as_json = json.loads(vast("config", "list", "-o", "json").out)
    assert as_json == yaml.safe_load(vast("config", "list", "-o", "yaml").out)
    names = vast("config", "list", "-o", "name").out.split()
    assert names == [record["name"] for record in as_json]
    assert as_json[0] == {"name": "sweep-1-1", "config": {"speed": 0.5, "goal": "door"}}


def test_debug_shows_keys_with_an_underscore(vast, sweep) -> None:
    record = json.loads(vast("config", "list", "-o", "json", "--debug").out)[0]
    assert record["_config_name"] == "sweep"
    assert record["_variations"] == [{"name": "ParameterVariationList"}] * 2
    assert "_config_name" in vast("config", "list", "--debug").out


def test_equal_files_give_equal_bytes(vast, sweep) -> None:
    text = sweep.read_text().replace(
        "values: [0.5, 1.0, 2.0]}", "num_variations: 5, min: 0, max: 9}"
    )
    sweep.write_text(text.replace("List: {name: speed", "DistributionUniform: {name: speed"))
    for output in ("table", "json", "yaml"):
        first = vast("config", "list", "-o", output, "--debug").out
        assert first == vast("config", "list", "-o", output, "--debug").out


def test_long_values_are_cut_in_the_table_alone(vast, sweep) -> None:
    sweep.write_text(sweep.read_text().replace("speed: 0.1 ", f"goal: {'x' * 50} "))
    assert f"{'x' * 39}…" in vast("config", "list").out
    assert "x" * 50 in vast("config", "list", "-o", "json").out


def test_info_counts_what_each_entry_makes(vast, sweep) -> None:
    out = vast("config", "info").out
    assert "scenario                drive (drive.osc)" in out
    assert out.splitlines()[-3:] == [
        "sweep  ParameterVariationList * ParameterVariationList  6               12",
        "fixed  fixed parameters                                 1               2",
        "total                                                   7               14",
    ]


def test_variation_points_are_the_scenarios_parameters(vast, sweep) -> None:
    assert vast("config", "variation-points").out == (
        'PARAMETER  TYPE    DEFAULT\nspeed      float   1.0\ndistance   float   5.0\n'
        'goal       string  "door"\n'
    )  # fmt: skip


def test_variation_types_tell_their_parameters(vast) -> None:
    out = vast("config", "variation-types").out
    assert "ParameterVariationList  (robovast-operator " in out
    assert "    name    required  The scenario parameter, or several that change together." in out


def test_generate_writes_a_campaign_before_its_first_run(vast, sweep, tmp_path) -> None:
    outcome = vast("config", "generate", "out")
    assert (outcome.code, outcome.out) == (0, "Wrote 7 configurations to out.\n")
    written = {str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").glob("*/*")}
    assert {"_config/drive.vast", "_config/drive.osc", "sweep-3-2/_config"} <= written
    assert "_transient/work" not in written
    parameters = yaml.safe_load((tmp_path / "out/fixed/_config/scenario.config").read_text())
    assert parameters == {"drive": {"speed": 0.1}}


def test_generate_writes_equal_files_for_equal_documents(vast, sweep, tmp_path) -> None:
    for name in ("one", "two"):
        vast("config", "generate", name)
    one, two = ({p.relative_to(r): p.read_bytes() for p in r.rglob("*") if p.is_file()}
                for r in (tmp_path / "one", tmp_path / "two"))  # fmt: skip
    assert one == two


PLUGIN = """\
import os
from pathlib import Path
from robovast.common.variation import Variation


class Maps(Variation):
    def variation(self, in_configs):
        cached = Path(os.environ["XDG_CACHE_HOME"]) / "made"
        text = "cached" if cached.exists() else "made"
        cached.write_text("x")
        made = Path(self.output_dir) / "map.txt"
        made.write_text(text)
        return [self.update_config(c, {}, [("map.txt", str(made))]) for c in in_configs]
"""


@pytest.fixture
def maps(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A .vast file whose variation makes a file and caches it."""
    (folder / "maps.py").write_text(PLUGIN)
    (folder / "cache").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    path = folder / "maps.vast"
    path.write_text(
        "version: 1\nconfiguration:\n- name: hall\n  variations:\n  - maps.py:Maps\n"
        "execution:\n  scenario_file: drive.osc\n"
    )
    return path


def test_keep_transient_keeps_what_variations_made_on_the_way(vast, maps, folder) -> None:
    vast("config", "generate", "out", "--keep-transient")
    assert (folder / "out/_transient" / "work/map.txt").is_file()
    assert (folder / "out/hall-1/_config/map.txt").is_file()


def test_no_cache_makes_everything_anew(vast, maps, folder) -> None:
    def made(name: str, *options: str) -> str:
        assert vast("config", "generate", name, *options).code == 0
        return (folder / name / "hall-1/_config/map.txt").read_text()

    assert made("first") == "made"
    assert made("second") == "cached"
    assert made("third", "--no-cache") == "made"


def test_generate_overwrites_nothing(vast, sweep, tmp_path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").write_text("x")
    outcome = vast("config", "generate", "out")
    assert (outcome.code, outcome.err) == (
        5,
        "error: cannot generate into out: the folder is not empty\nhint: choose a new folder, or "
        "empty this one\n",
    )
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["mine"]


def test_exported_entries_run_the_same_again(vast, sweep, tmp_path) -> None:
    outcome = vast("config", "export-configs", "sweep-2-*", "fixed", "-o", "some.yaml")
    assert (outcome.code, outcome.out) == (0, "Wrote 3 configurations to some.yaml.\n")
    (tmp_path / "again.vast").write_text("version: 1\nexecution: {scenario_file: drive.osc}\n")
    assert vast("-V", "again.vast", "config", "import-configs", "some.yaml").code == 0
    again = json.loads(vast("-V", "again.vast", "config", "list", "-o", "json").out)
    whole = json.loads(vast("-V", "drive.vast", "config", "list", "-o", "json").out)
    assert again == [r for r in whole if r["name"] in {"sweep-2-1", "sweep-2-2", "fixed"}]


def test_export_goes_to_stdout_and_overwrites_nothing(vast, sweep, tmp_path) -> None:
    text = vast("config", "export-configs", "fixed").out
    assert text == "version: 1\nconfiguration:\n- name: fixed\n  parameters:\n  - speed: 0.1\n"
    outcome = vast("config", "export-configs", "fixed", "-o", "drive.vast")
    assert (outcome.code, outcome.err) == (
        5,
        "error: drive.vast: cannot be written: File exists\n",
    )


def test_configurations_with_files_of_their_own_cannot_be_exported(vast, maps) -> None:
    outcome = vast("config", "export-configs", "*")
    assert outcome.code == 2
    assert "its variations create files (map.txt)" in outcome.err


def test_import_from_a_generated_campaign(vast, sweep, tmp_path) -> None:
    vast("config", "generate", "campaign")
    (tmp_path / "again.vast").write_text("version: 1\nexecution: {scenario_file: drive.osc}\n")
    assert vast("-V", "again.vast", "config", "import-configs", "campaign").code == 0
    assert len(vast("-V", "again.vast", "config", "list", "-o", "name").out.split()) == 7


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("fixed", "configurations with these names exist already: fixed\nhint: rename them"),
        ("sweep-2-1", "no configuration was added, because"),  # a variation creates it
    ],
)
def test_import_that_would_break_the_file_changes_nothing(
    vast, sweep, tmp_path, name: str, cause: str
) -> None:
    before = sweep.read_bytes()
    (tmp_path / "more.yaml").write_text(f"configuration: [{{name: new}}, {{name: {name}}}]\n")
    outcome = vast("-V", sweep, "config", "import-configs", "more.yaml")
    assert outcome.code == 2
    assert cause in outcome.err
    assert sweep.read_bytes() == before


def test_import_leaves_out_what_cannot_be_expanded(vast, sweep, tmp_path) -> None:
    bad = [{"name": "odd", "parameters": [{"colour": "red"}]}, {"name": "a/b"}, 7]
    good = {
        "name": "new",
        "variations": [{"ParameterVariationList": {"name": "speed", "values": [3]}}],
    }
    (tmp_path / "more.yaml").write_text(yaml.safe_dump({"configuration": [*bad, good]}))
    outcome = vast("-V", sweep, "config", "import-configs", "more.yaml")
    assert (outcome.code, outcome.out) == (0, "Added 1 configuration to drive.vast.\n")
    lines = outcome.err.splitlines()
    assert lines[0].startswith(
        "more.yaml: `odd` is skipped: configuration[0].parameters[0].colour:"
    )
    assert lines[1].startswith("more.yaml: `a/b` is skipped: configuration[0].name:")
    assert lines[2].startswith("more.yaml: `7` is skipped: ")
    assert vast("config", "list", "-o", "name").out.split()[-1] == "new-1"
    before = sweep.read_bytes()
    (tmp_path / "more.yaml").write_text(yaml.safe_dump({"configuration": bad}))
    outcome = vast("-V", sweep, "config", "import-configs", "more.yaml")
    assert outcome.code == 2
    assert "no configuration can be used" in outcome.err
    assert sweep.read_bytes() == before


def test_export_takes_its_file_as_the_last_argument(vast, sweep, tmp_path) -> None:
    outcome = vast("config", "export-configs", "fixed", "f.vast", "--input", "drive.vast")
    assert (outcome.code, outcome.out) == (0, "Wrote 1 configuration to f.vast.\n")


def test_gui_says_what_stands_in_its_place(vast, sweep) -> None:
    outcome = vast("config", "gui", "--debug")
    assert outcome.code == 0
    assert "your own editor" in outcome.err
    assert "_config_name" in outcome.out


NEW = [{"name": "new", "parameters": [{"speed": 1}]}]

TEXTS = {
    "comments stay": (
        "configuration:\n- name: a  # first\n# the end\n\nexecution: {}\n",
        "configuration:\n- name: a  # first\n- name: new\n  parameters:\n  - speed: 1\n"
        "# the end\n\nexecution: {}\n",
    ),
    "indented": (
        "configuration:\n    - name: a\n      parameters:\n      - x: |\n          text\n",
        "configuration:\n    - name: a\n      parameters:\n      - x: |\n          text\n"
        "    - name: new\n      parameters:\n      - speed: 1\n",
    ),
    "no newline at the end": (
        "configuration:\n- {name: a, parameters: [x: [1, 2]]}",
        "configuration:\n- {name: a, parameters: [x: [1, 2]]}\n"
        "- name: new\n  parameters:\n  - speed: 1\n",
    ),
    "empty section": (
        "configuration:  # later\nexecution: {}\n",
        "configuration:  # later\n- name: new\n  parameters:\n  - speed: 1\nexecution: {}\n",
    ),
    "no section": (
        "version: 1\n",
        "version: 1\nconfiguration:\n- name: new\n  parameters:\n  - speed: 1\n",
    ),
    "line ends of Windows": (
        "configuration:\r\n- name: a\r\nexecution: {}\r\n",
        "configuration:\r\n- name: a\r\n- name: new\r\n  parameters:\r\n  - speed: 1\r\n"
        "execution: {}\r\n",
    ),
}


@pytest.mark.parametrize("case", TEXTS)
def test_entries_are_added_to_the_text_as_it_is(case: str) -> None:
    before, after = TEXTS[case]
    assert append_entries(before, NEW, Path("x.vast")) == after


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("version: 1\nconfiguration: [{name: a}]\n", "x.vast:2:16"),
        ("{version: 1}\n", "x.vast:1:1"),
    ],
)
def test_a_list_in_brackets_is_left_to_the_user(text: str, place: str) -> None:
    with pytest.raises(InputError, match=f"^{place}: "):
        append_entries(text, NEW, Path("x.vast"))
