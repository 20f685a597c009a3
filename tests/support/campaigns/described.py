"""Campaigns as the existing tool leaves them, made without running anything.

With floor plans by a variation type in a file, ROS bags and postprocessing: every query of the
developer guide has something to find.
"""

from __future__ import annotations

import json
from pathlib import Path

from robovast.base.serialization import dump_yaml
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict

NAME = "hall_tests-2026-03-04-152130"
RECORD = RunRecord(
    campaign=NAME,
    variant="hall-1-1",
    entry="hall",
    run=0,
    id=0,
    verdict=Verdict.PASSED,
    reason="",
    started_at="2026-03-04T15:21:30+00:00",
    finished_at="2026-03-04T15:21:32+00:00",
    duration=2.0,
    exit_code=0,
    attempt=1,
    job="job-0",
    runtime="docker",
    image="",
    image_digest="",
    host="h",
)
DATASET = "https://example.org/datasets/halls/"

DOCUMENT = """\
version: 1
metadata:
  name: hall_tests
  title: Halls
  license: https://creativecommons.org/licenses/by/4.0/
  creator: {name: Ada Example, orcid: 0000-0002-1825-0097}
  dataset_iri: https://example.org/datasets/halls/
  agents:
  - {name: turtlebot4, type: robot, configuration_files: [files/robot.yaml], mass: 3.9}
configuration:
- name: hall
  variations:
  - plans.py:Plans: {}
  - ParameterVariationList: {name: x, values: [1, 2]}
execution: {scenario_file: scenario.osc, runs: 2}
"""

PLANS = """\
from robovast.common.variation import ProvContribution, Variation

ENV = "https://purl.org/secorolab/metamodels/environment#"
ROBOVAST = "https://purl.org/robovast/metamodels/"
GENERATOR = "https://example.org/generator"


class Plans(Variation):
    @classmethod
    def collect_config_metadata(cls, config_entry, config_dir, campaign_dir):
        return {"floor_plan": config_entry["config"]["plan"]}

    @classmethod
    def collect_prov_metadata(
        cls, config_entry, campaign_namespace, config_namespace, gen_activity_id, vast_id
    ):
        from rdflib import DCTERMS, PROV, Literal, Namespace, XSD

        env, robovast = Namespace(ENV), Namespace(ROBOVAST)
        model = campaign_namespace["_config/" + config_entry["floor_plan"]]
        transformation = config_namespace["jsonld_generation/"]
        generation = config_namespace["artefact_generation/"]
        linked, image = config_namespace["plan.json"], config_namespace["maps/hall.pgm"]
        modified = Literal("2026-01-02T03:04:05Z", datatype=XSD.dateTime)
        return ProvContribution(
            graph_nodes=[
                {
                    "@id": model,
                    "@type": [PROV["Entity"], env["Environment"], env["FloorPlanModel"]],
                    DCTERMS["modified"]: modified,
                    PROV["wasAttributedTo"]: "https://orcid.org/0000-0002-1825-0097",
                },
                {
                    "@id": transformation,
                    "@type": [PROV["Activity"], robovast["FloorPlanTransformation"]],
                    "used": model,
                    "wasAssociatedWith": GENERATOR,
                },
                {"@id": GENERATOR, "@type": PROV["SoftwareAgent"]},
                {
                    "@id": linked,
                    "@type": [PROV["Entity"], env["FloorPlanGraphModel"]],
                    "wasGeneratedBy": transformation,
                },
                {
                    "@id": generation,
                    "@type": [PROV["Activity"], robovast["FloorPlanGeneration"]],
                    "used": linked,
                },
                {
                    "@id": image,
                    "@type": [PROV["Entity"], env["OccupancyGrid"]],
                    "wasGeneratedBy": generation,
                },
            ],
            scenario_properties={DCTERMS["references"]: [model, image], robovast["n_goals"]: 2},
            run_used_iris=[image],
        )
"""

BAG_METADATA = """\
rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  topics_with_message_count:
  - topic_metadata: {name: /tf, type: tf2_msgs/msg/TFMessage, serialization_format: cdr}
    message_count: 3
  - topic_metadata:
      name: /odom
      type: nav_msgs/msg/Odometry
    message_count: 3
  ros_distro: jazzy
"""

SYSINFO = {
    "platform": {"platform": "Linux-6.1", "system": "Linux", "machine": "x86_64"},
    "cpu_name": "Example 9000",
    "available_cpus": 2,
    "available_mem": 4294967296,
}

PLAN_NAMES = ("hall.fpm", "ramp.fpm")


def make_old_campaign(
    results: Path, configurations: int = 2, runs: int = 2, name: str = NAME
) -> Path:
    """A campaign of the existing tool: every second configuration fails its run 0."""
    root = results / name
    _write(root / "_config/hall.vast", DOCUMENT)
    _write(root / "_config/plans.py", PLANS)
    _write(root / "_config/scenario.osc", "scenario hall:\n    x: int = 1\n")
    _write(root / "_config/files/robot.yaml", "{}\n")
    execution = {
        "execution_time": "2026-03-04T15:21:30",
        "robovast_version": "abc123",
        "runs": runs,
        "execution_type": "cluster",
        "image": "ghcr.io/example:latest",
    }
    _write(root / "_execution/execution.yaml", dump_yaml(execution))
    configs = [_configuration(root, index) for index in range(configurations)]
    record = {
        "vast": "hall.vast",
        "scenario_file": "scenario.osc",
        "configs": configs,
        "_run_files": ["files/robot.yaml"],
        "_input_files": ["hall.vast", "scenario.osc"],
    }
    _write(root / "_transient/configurations.yaml", dump_yaml(record))
    for index, config in enumerate(configs):
        for number in range(runs):
            passed = bool(index % 2 == 0 or number)
            _make_run(root, config["name"], number, index * runs + number, passed=passed)
    return root


def _configuration(root: Path, index: int) -> dict[str, object]:
    name = f"hall-1-{index + 1}"
    identity = {"config_identifier": f"id-{index}", "sub_identifier": {"block": "b"}}
    _write(root / name / "_config/config.yaml", dump_yaml(identity))
    _write(root / name / "_config/scenario.config", dump_yaml({"hall": {"x": index}}))
    _write(root / name / "_config/goals.yaml", "[]\n")
    timed = [
        {"name": "plans.py:Plans", "started_at": "2026-03-04T15:20:00+00:00", "duration": 1.5},
        {
            "name": "ParameterVariationList",
            "started_at": "2026-03-04T15:20:02+00:00",
            "duration": 0.25,
        },
    ]
    return {
        "name": name,
        "config": {"x": index, "plan": PLAN_NAMES[index % len(PLAN_NAMES)]},
        "_config_name": "hall",
        "_config_files": [["goals.yaml", "/gone/goals.yaml"]],
        "_variations": timed,
        "_path": [[0.0, 1.0]],
    }


def _make_run(root: Path, name: str, number: int, job: int, *, passed: bool) -> None:
    folder = root / name / str(number)
    bag = folder / "rosbag2"
    _write(bag / "metadata.yaml", BAG_METADATA)
    (bag / "rosbag2_0.mcap").write_bytes(b"\x89MCAP")
    _write(folder / "test.xml", verdict_file(passed))
    _write(folder / "logs/nav.log", "hello\n")
    _write(folder / "poses.csv", "frame,timestamp\n")
    entry = {
        "output": f"{root.name}/{name}/{number}/poses.csv",
        "sources": [f"{root.name}/{name}/{number}/rosbag2"],
        "plugin": "rosbags_tf_to_csv",
        "params": {"frames": ["base_link"]},
    }
    _write(folder / "postprocessing.yaml", dump_yaml({"entries": [entry]}))
    _write(root / f"_jobs/job-{job}/sysinfo.yaml", dump_yaml(SYSINFO))
    _write(root / f"_jobs/job-{job}/logs/system.log", "started\n")
    (folder / "job").symlink_to(f"../../_jobs/job-{job}")


def verdict_file(passed: bool) -> str:
    """Content of a test.xml."""
    return (
        f'<testsuite errors="0" failures="{0 if passed else 1}" name="s" tests="1" time="49.03">'
        '<testcase classname="tests.scenario" name="t" time="49.03"><properties>'
        f'<property name="start_time" value="1772637690.5"/></properties>'
        + ("" if passed else '<failure message="it hit the wall"/>')
        + "</testcase></testsuite>\n"
    )


def nodes_of(root: Path) -> list[dict[str, object]]:
    """The nodes of a campaign's graph as they are written."""
    nodes: list[dict[str, object]] = json.loads((root / "metadata.prov.json").read_text())["@graph"]
    return nodes


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
