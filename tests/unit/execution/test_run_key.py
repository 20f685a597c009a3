"""Keys of runs: equal for equal inputs, different for everything that could matter."""

from __future__ import annotations

import copy
import random
from pathlib import Path
from typing import Any

import pytest

from robovast.execution.job_config import SEED_VARIABLE
from robovast.execution.local.runtime import Limits
from robovast.execution.run_key import common_key, run_keys
from robovast.model.plan import PackStart, Run
from robovast.model.scenario import Scenario
from robovast.model.variant import ConfigFile, Variant

INPUTS: dict[str, Any] = {
    "settings": {
        "runtime": ["docker", "/config", "sha256:1"],
        "environment": {"A": "1", "AVAILABLE_CPUS": "2", "PRE_COMMAND": "x"},
        "user": "1000:1000",
        "limits": {"cpus": 1.0, "memory": 100, "gpus": 1, "shm": 5},
        "timeout": 60,
        "network": False,
    },
    "files": {"scenario.osc": "scenario", "files/map.yaml": "map", "entrypoint.sh": "#!"},
    "runs": [
        {"name": "hall-1", "number": 0, "seed": 7, "parameters": {"speed": 1.5}, "files": {}},
        {
            "name": "hall-1",
            "number": 1,
            "seed": 8,
            "parameters": {"speed": 1.5, "list": [1, 2], "text": "1"},
            "files": {"plan.fpm": "room", "b/c.yaml": "c"},
        },
    ],
}


def keys(inputs: dict[str, Any], folder: Path) -> list[str]:
    """The keys of two runs of one pack, of the last one alone, and of one after another job."""
    for path, content in inputs["files"].items():
        _write(folder / "common" / path, content)
    settings = {**inputs["settings"], "limits": [Limits(**inputs["settings"]["limits"])]}
    common = common_key(settings, folder / "common")
    job = PackStart(0, tuple(_run(i, data, folder) for i, data in enumerate(inputs["runs"])))
    return list(run_keys(common, job, Scenario("test", ())).values())


def _write(path: Path, content: str) -> None:
    """Write a file that has other content: to write takes far longer than to look."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text() != content:
        path.write_text(content)


def _run(id_: int, data: dict[str, Any], folder: Path) -> Run:
    files = []
    for name, content in data["files"].items():
        path = folder / f"own-{id_}" / name
        _write(path, content)
        files.append(ConfigFile(name, path))
    variant = Variant(data["name"], "hall", data["parameters"], tuple(files))
    return Run(id_, variant, data["number"], data["seed"])


def test_equal_inputs_have_equal_keys_wherever_they_are(tmp_path: Path) -> None:
    assert keys(INPUTS, tmp_path / "a") == keys(copy.deepcopy(INPUTS), tmp_path / "b")


def test_what_belongs_to_the_campaign_or_the_job_does_not_count(tmp_path: Path) -> None:
    other = copy.deepcopy(INPUTS)
    own = {"CAMPAIGN_ID": "hall-2", "OUTPUT_DIR": "/out/_jobs/job-5", SEED_VARIABLE: "9"}
    other["settings"]["environment"].update(own)
    assert keys(other, tmp_path / "a") == keys(INPUTS, tmp_path / "b")


def test_no_mutation_keeps_the_key_of_the_last_run(tmp_path: Path) -> None:
    """A thousand inputs that differ in one place each."""
    generator = random.Random(1)  # noqa: S311
    (known,) = keys(INPUTS, tmp_path)[1:]
    for _ in range(1000):
        changed = copy.deepcopy(INPUTS)
        what = _mutate(changed, generator)
        assert keys(changed, tmp_path)[-1] != known, what


def test_a_file_that_is_executable_is_another_one(tmp_path: Path) -> None:
    before = keys(INPUTS, tmp_path)
    (tmp_path / "own-1/plan.fpm").chmod(0o755)
    between = keys(INPUTS, tmp_path)
    assert (between[0], between[1] == before[1]) == (before[0], False)
    (tmp_path / "common/entrypoint.sh").chmod(0o755)
    assert not set(between) & set(keys(INPUTS, tmp_path))


def test_a_run_of_a_pack_depends_on_those_before_it_alone(tmp_path: Path) -> None:
    first = keys(INPUTS, tmp_path / "a")
    other = copy.deepcopy(INPUTS)
    other["runs"][1]["seed"] = 9
    changed = keys(other, tmp_path / "b")
    assert (changed[0], changed[1] == first[1]) == (first[0], False)


def test_without_a_common_part_there_is_no_key() -> None:
    job = PackStart(0, (Run(3, Variant("a", "a", {}), 0, 1),))
    assert run_keys("", job, Scenario("test", ())) == {3: ""}


@pytest.mark.parametrize(("one", "other"), [(1, "1"), (1, 1.0), (True, 1), (None, "null")])
def test_values_of_other_types_are_others(one: object, other: object, tmp_path: Path) -> None:
    found = set()
    for number, value in enumerate((one, other)):
        inputs = copy.deepcopy(INPUTS)
        inputs["runs"][1]["parameters"]["speed"] = value
        found.add(keys(inputs, tmp_path / str(number))[-1])
    assert len(found) == 2


def _mutate(data: Any, generator: random.Random) -> str:
    """Change one place of nested data: a value, or an additional one."""
    path = []
    while True:
        places = list(data) if isinstance(data, dict) else list(range(len(data)))
        place = generator.choice(places)
        path.append(str(place))
        if isinstance(data[place], dict | list) and data[place]:
            data = data[place]
            continue
        data[place] = _other(data[place], generator)
        return "/".join(path)


def _other(value: Any, generator: random.Random) -> Any:
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value + generator.choice([1, 2, 3, 1000])
    if isinstance(value, str):
        at = generator.randrange(len(value) + 1)
        return value[:at] + generator.choice("abc0 ") + value[at:]
    return {"more": "x"}
