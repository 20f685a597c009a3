"""metadata.yaml: what is in it, what hooks and processors add, what is missing."""

from __future__ import annotations

import logging
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from support.campaigns.described import DOCUMENT, NAME, RECORD, SYSINFO, make_old_campaign

from robovast.analysis.provenance import PluginFaultsError, describe, write_metadata
from robovast.campaign.verdict import Verdict


def read(root: Path) -> dict:
    return yaml.safe_load((root / "metadata.yaml").read_text())


def written(root: Path) -> dict:
    assert write_metadata(root) == root / "metadata.yaml"
    return read(root)


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    return make_old_campaign(tmp_path)


def use_processors(root: Path, code: str, *calls: str) -> None:
    """Let the .vast file of a campaign name processors in a file beside it."""
    (root / "_config/processors.py").write_text(
        f"from robovast.common.metadata import MetadataProcessor\n\n\n{code}"
    )
    lines = "".join(f"  - {call}\n" for call in calls)
    text = f"{DOCUMENT}results_processing:\n  metadata_processing:\n{lines}"
    (root / "_config/hall.vast").write_text(text)


def test_the_campaign_is_described(campaign: Path) -> None:
    metadata = written(campaign)
    assert metadata["run_files"] == ["_config/files/robot.yaml"]
    assert metadata["scenario_file"] == "scenario.osc"
    assert metadata["metadata"]["title"] == "Halls"
    assert metadata["execution"]["execution_type"] == "cluster"
    entry = metadata["configurations"][1]
    assert entry["name"] == "hall-1-2"
    assert entry["config"] == {"x": 1, "plan": "ramp.fpm"}
    assert entry["config_files"] == ["hall-1-2/_config/goals.yaml"]
    assert entry["config_identifier"] == "id-1"
    assert entry["created_at"] == "2026-03-04T15:20:02.250000+00:00"
    assert [v["name"] for v in entry["variations"]] == ["plans.py:Plans", "ParameterVariationList"]


def test_a_run_is_described(campaign: Path) -> None:
    result = written(campaign)["configurations"][1]["test_results"][0]
    assert result["dir"] == "hall-1-2/0"
    assert (result["success"], result["reason"]) == ("false", "it hit the wall")
    assert result["start_time"] == "2026-03-04T15:21:30.500000+00:00"
    assert result["end_time"] == "2026-03-04T15:22:19.530000+00:00"
    assert "hall-1-2/0/logs/nav.log" in result["output_files"]
    assert result["sysinfo"] == SYSINFO
    assert result["rosbag2"] == {
        "files": ["metadata.yaml", "rosbag2_0.mcap"],
        "ros_distro": "jazzy",
        "message_types": ["nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"],
    }
    assert result["postprocessing"]["entries"][0]["plugin"] == "rosbags_tf_to_csv"


def test_runs_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    campaign = make_old_campaign(tmp_path, configurations=1, runs=11)
    results = written(campaign)["configurations"][0]["test_results"]
    assert [result["dir"] for result in results[-2:]] == ["hall-1-1/9", "hall-1-1/10"]


def test_hooks_of_variations_add_to_the_entry(campaign: Path) -> None:
    entries = written(campaign)["configurations"]
    assert [entry["floor_plan"] for entry in entries] == ["hall.fpm", "ramp.fpm"]


PROCESSORS = """\
class Note(MetadataProcessor):
    def process_metadata(self, metadata, campaign_dir):
        metadata.setdefault("notes", []).append([self.text, campaign_dir.name])
        return metadata


class Plain(MetadataProcessor):
    def process_metadata(self, metadata: dict, campaign_dir) -> dict:
        return {**metadata, "custom_field": "custom_value"}
"""


def test_processors_work_in_their_order_with_their_parameters(campaign: Path) -> None:
    use_processors(
        campaign,
        PROCESSORS,
        "processors.py:Plain",
        "processors.py:Note: {text: first}",
        "processors.py:Note: {text: second}",
    )
    metadata = written(campaign)
    assert metadata["custom_field"] == "custom_value"
    assert metadata["notes"] == [["first", NAME], ["second", NAME]]


def test_plugins_in_files_of_the_campaign_are_left_out_on_demand(campaign: Path) -> None:
    code = f"import os; os.mkdir({str(campaign / 'executed')!r})\n{PROCESSORS}"
    use_processors(campaign, code, "processors.py:Plain")
    describe(campaign, own_plugins=False)
    assert not (campaign / "executed").exists()
    assert "custom_field" not in (campaign / "metadata.yaml").read_text()
    describe(campaign)
    assert (campaign / "executed").exists()
    assert "custom_field" in (campaign / "metadata.yaml").read_text()


BAD_PROCESSORS = {
    "raises": ("metadata['half'] = 1; raise KeyError('speed')", "KeyError: 'speed'"),
    "returns nothing": ("metadata['half'] = 1", "returned a NoneType, not the metadata (a dict)"),
    "loses the configurations": ("return {}", "without a list of `configurations`"),
    "returns what YAML cannot hold": (
        "metadata['half'] = object(); return metadata",
        "cannot be written as YAML or JSON",
    ),
}


@pytest.mark.parametrize(("body", "cause"), BAD_PROCESSORS.values(), ids=BAD_PROCESSORS)
def test_a_bad_processor_is_named_and_the_rest_written(
    campaign: Path, body: str, cause: str
) -> None:
    head = "class Bad(MetadataProcessor):\n    def process_metadata(self, metadata, d):\n"
    code = f"{head}        {body}\n\n\n{PROCESSORS}"
    use_processors(campaign, code, "processors.py:Bad", "processors.py:Plain")
    with pytest.raises(PluginFaultsError) as caught:
        write_metadata(campaign)
    assert len(caught.value.faults) == 1
    assert caught.value.faults[0].startswith("processors.py:Bad: ")
    assert cause in str(caught.value)
    metadata = read(campaign)
    assert metadata["custom_field"] == "custom_value"
    assert "half" not in metadata
    assert len(metadata["configurations"]) == 2


@pytest.mark.parametrize(
    ("call", "cause"),
    [
        ("nowhere", "there is no plugin `nowhere` in robovast.metadata_processing"),
        ("processors.py:Absent", "has no `Absent`"),
        ("processors.py:Path", "must be a class that inherits"),
        ("{a: 1, b: 2}", "must be a plugin's name"),
    ],
)
def test_a_processor_that_cannot_be_used_is_named(campaign: Path, call: str, cause: str) -> None:
    use_processors(campaign, f"from pathlib import Path\n\n\n{PROCESSORS}", call)
    with pytest.raises(PluginFaultsError) as caught:
        write_metadata(campaign)
    assert cause in str(caught.value)
    assert len(read(campaign)["configurations"]) == 2


BAD_HOOKS = {
    "raises": ("raise RuntimeError('no map')", "RuntimeError: no map"),
    "exits": ("raise SystemExit(3)", "SystemExit: 3"),
    "returns nonsense": ("return 5", "it returned a int, not a dict"),
    "takes over": ("return {'test_results': []}", "`test_results`, which no hook may set"),
}


@pytest.mark.parametrize(("body", "cause"), BAD_HOOKS.values(), ids=BAD_HOOKS)
def test_a_bad_hook_is_named_once_with_its_configurations(
    campaign: Path, body: str, cause: str
) -> None:
    (campaign / "_config/plans.py").write_text(
        "from robovast.common.variation import Variation\n\n\nclass Plans(Variation):\n"
        "    @classmethod\n    def collect_config_metadata(cls, entry, config_dir, campaign_dir):\n"
        f"        {body}\n"
    )
    with pytest.raises(PluginFaultsError) as caught:
        write_metadata(campaign)
    (fault,) = caught.value.faults
    assert fault.startswith("plans.py:Plans.collect_config_metadata: ")
    assert cause in fault
    assert fault.endswith("(in hall-1-1, hall-1-2)")
    assert len(read(campaign)["configurations"][0]["test_results"]) == 2


def test_missing_pieces_are_stated_and_never_fatal(
    campaign: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (campaign / "hall-1-1/0/test.xml").unlink()
    (campaign / "hall-1-1/1/job").unlink()
    (campaign / "hall-1-1/1/run.json").write_text('{"verd')
    shutil.rmtree(campaign / "_execution")
    shutil.rmtree(campaign / "hall-1-2/0")
    shutil.rmtree(campaign / "hall-1-2/1")
    with caplog.at_level(logging.WARNING):
        metadata = written(campaign)
    assert caplog.messages == [
        f"{NAME}: no execution.yaml: {NAME}",
        f"{NAME}: no test.xml: hall-1-1/0",
        f"{NAME}: no run.json that this version understands: hall-1-1/1",
        f"{NAME}: no sysinfo.yaml: hall-1-1/1",
        f"{NAME}: configurations without a run: hall-1-2",
    ]
    first = metadata["configurations"][0]["test_results"][0]
    assert (first["success"], first["verdict"]) == ("false", "errored")
    assert "start_time" not in first


def test_only_the_first_document_of_a_vast_file_counts(
    campaign: Path, caplog: pytest.LogCaptureFixture
) -> None:
    before = written(campaign)["metadata"]
    (document,) = (campaign / "_config").glob("*.vast")
    document.write_text(document.read_text() + "\n---\nmetadata: {name: other}\n")
    with caplog.at_level(logging.WARNING):
        assert written(campaign)["metadata"] == before
    assert not caplog.messages


def test_a_configuration_is_a_folder_of_the_campaign(campaign: Path) -> None:
    path = campaign / "_transient/configurations.yaml"
    path.write_text(path.read_text().replace("name: hall-1-1\n", "name: ../hall-1-1\n"))
    assert [entry["name"] for entry in written(campaign)["configurations"]] == [
        "hall-1-2", "hall-1-1"
    ]  # fmt: skip


def test_an_aborted_campaign_is_described_by_its_folders(campaign: Path) -> None:
    (campaign / "_transient/configurations.yaml").unlink()
    (campaign / "_config/hall.vast").unlink()
    metadata = written(campaign)
    assert [entry["name"] for entry in metadata["configurations"]] == ["hall-1-1", "hall-1-2"]
    assert metadata["configurations"][1]["config"] == {"x": 1}
    assert len(metadata["configurations"][1]["test_results"]) == 2


def test_an_unknown_variation_type_is_stated(
    campaign: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = campaign / "_transient/configurations.yaml"
    path.write_text(path.read_text().replace("ParameterVariationList", "LunarGravity"))
    written(campaign)
    assert caplog.messages == [
        f"{NAME}: variation types that are not installed, nothing added: LunarGravity"
    ]


@pytest.mark.parametrize("content", [b"\xff\xfe: [", b"- 1\n", b"a: \x00\n", b""])
def test_damaged_files_are_stated(
    campaign: Path, content: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("_config/hall.vast", "hall-1-1/_config/config.yaml"):
        (campaign / name).write_bytes(content)
    assert len(written(campaign)["configurations"]) == 2
    assert [m for m in caplog.messages if "config.yaml" in m and "hall-1-1" in m]


def test_text_that_is_not_utf_8_is_kept_as_far_as_it_can_be_read(campaign: Path) -> None:
    result = campaign / "hall-1-2/0/test.xml"
    result.write_bytes(result.read_bytes().replace(b"the wall", b"the M\xfcll"))
    (campaign / "hall-1-2/0").joinpath("caf\udce9.csv").write_text("")
    entry = written(campaign)["configurations"][1]["test_results"][0]
    assert entry["reason"] == "it hit the M\ufffdll"
    assert "hall-1-2/0/caf\\xe9.csv" in entry["output_files"]


def test_results_of_a_local_campaign_come_from_its_records(campaign: Path) -> None:
    record = replace(
        RECORD, verdict=Verdict.INTERRUPTED, started_at="2026-03-04T16:00:00+01:00", finished_at=""
    )
    record.write(campaign / "hall-1-1/0")
    result = written(campaign)["configurations"][0]["test_results"][0]
    assert (result["success"], result["verdict"]) == ("false", "interrupted")
    assert result["start_time"] == "2026-03-04T15:00:00+00:00"


def test_a_campaign_of_another_tool_gets_one_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    run = tmp_path / NAME / "c" / "0"
    run.mkdir(parents=True)
    (run / "test.xml").write_text('<testsuite tests="1"><testcase name="a"/></testsuite>')
    (tmp_path / NAME / "_config").mkdir()
    (tmp_path / NAME / "_config" / "c.vast").write_text("version: 1\n")
    write_metadata(tmp_path / NAME)
    (warning,) = [record.getMessage() for record in caplog.records]
    for name in ("configurations.yaml", "execution.yaml", "config.yaml", "sysinfo.yaml"):
        assert name in warning
    assert "another tool ran this campaign" in warning


def test_a_key_that_is_no_text_is_described(campaign: Path) -> None:
    path = campaign / "_transient" / "configurations.yaml"
    data = yaml.safe_load(path.read_text())
    data["configs"][0]["config"][1] = 3
    path.write_text(yaml.safe_dump(data))
    assert written(campaign)["configurations"][0]["parameters"]["1"] == 3
