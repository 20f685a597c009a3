"""Values that scenario-execution would refuse are found before anything runs, with their place."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import DocumentError, InputError
from robovast.model.document import load_document
from robovast.model.expansion import expand

SCENARIO = """\
struct box:
    height: length = 1.0m

scenario drive:
    count: int = 3
    speed: float = 0.5
    length_of_way: length
    wait_time: time = 1s
    fast: bool = false
    word: string = "a"
    goal: pose_3d
    boxes: list of box
    unknown: their_own_type
    do serial:
        emit end
"""
SEARCH = """\
search:
  strategy: random
  search_space: {{{space}}}
  {more}
  objectives: [{{name: failure_rate}}]
  budget: [{{batches: 1}}]
"""


@pytest.fixture(autouse=True)
def _scenario(tmp_path: Path) -> None:
    (tmp_path / "drive.osc").write_text(SCENARIO)


def document(folder: Path, text: str) -> Path:
    path = folder / "drive.vast"
    path.write_text(f"version: 1\nexecution: {{scenario_file: drive.osc, runs: 1}}\n{text}")
    return path


def problem(folder: Path, text: str) -> str:
    with pytest.raises(DocumentError) as raised:
        load_document(document(folder, text))
    (found,) = raised.value.problems
    return str(found).removeprefix(f"{folder}/")


def of_entry(folder: Path, key: str, item: str) -> str:
    return problem(folder, f"configuration:\n- name: a\n  {key}:\n  - {item}\n")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("count: 40.5", "`count` must be a whole number, not 40.5"),
        ("count: 40.0", "`count` must be a whole number, not 40.0"),
        ("count: many", '`count` must be a whole number, not "many"'),
        ("count: null", "`count` must be a whole number, not null"),
        ("speed: one", '`speed` must be a number, not "one"'),
        ("length_of_way: 3m", '`length_of_way` must be a number, not "3m"'),
        ("speed: {2026-01-01: 1}", '`speed` must be a number, not {"2026-01-01": 1}'),
        ("wait_time: 2.5", "`wait_time` must be a whole number, as its default `1s` is, not 2.5"),
        ("fast: 1", "`fast` must be true or false, not 1"),
        ("goal: {position: {x: a}}", '`goal.position.x` must be a number, not "a"'),
        ("goal: {place: {x: 1}}", "`goal` has no field `place`, but position, orientation"),
        ("goal: [1, 2]", "`goal` must be a mapping of position, orientation, not [1, 2]"),
        ("boxes: {height: 1}", '`boxes` must be a list, not {"height": 1}'),
        ("boxes: [{height: 1}, {height: a}]", '`boxes[1].height` must be a number, not "a"'),
    ],
)
def test_a_wrong_value_is_told(tmp_path: Path, given: str, said: str) -> None:
    told = of_entry(tmp_path, "parameters", given)
    name = given.partition(":")[0]
    place = f"drive.vast:6:{len(name) + 7}: configuration[0].parameters[0].{name}"
    assert told.startswith(f"{place}: {said}\n")
    assert f"declares `{name}: " in told


def test_what_no_file_can_be_called_is_told(tmp_path: Path) -> None:
    path = tmp_path / "odd.vast"
    path.write_text('version: 1\nexecution: {scenario_file: "a\\0.osc", runs: 1}\n')
    with pytest.raises(DocumentError, match=r"no file can be called '.*a\\x00.osc'"):
        load_document(path)


def test_line_and_remedy(tmp_path: Path) -> None:
    assert of_entry(tmp_path, "parameters", "count: 40.5").endswith(
        "drive.osc:5 declares `count: int = 3`: give such values, or change that line."
    )


def test_right_values_are_accepted(tmp_path: Path) -> None:
    given = (
        "[count: 3, speed: 2, length_of_way: 2.5, wait_time: 3, fast: true, word: 5, goal: "
        "{position: {x: 1, y: 2.5}}, boxes: [{height: 2}], unknown: [anything]]"
    )
    text = f"configuration:\n- name: a\n  parameters: {given}\n"
    assert load_document(document(tmp_path, text)).vast.configuration


@pytest.mark.parametrize(
    ("variation", "place", "said"),
    [
        ("List: {name: count, values: [1, '2', 40.5]}", ".values[2]", "not 40.5"),
        ("List: {name: [speed, count], values: [[1, 2], [1, 2.5]]}", ".values[1][1]", "not 2.5"),
        ("DistributionUniform: {name: count, num_variations: 1, min: 1, max: 2}", "", "not 0.5"),
        (
            "DistributionUniform: {name: count, type: text, num_variations: 1, min: 1, max: 2}",
            ".type",
            'not "1"',
        ),
    ],
)
def test_values_of_variations(tmp_path: Path, variation: str, place: str, said: str) -> None:
    told = of_entry(tmp_path, "variations", f"ParameterVariation{variation}")
    name = f"ParameterVariation{variation.partition(':')[0]}"
    where = f": configuration[0].variations[0].{name}{place}: "
    assert f"{where}`count` must be a whole number, {said}\n" in told


@pytest.mark.parametrize(
    ("space", "more", "said"),
    [
        ("count: {type: float, low: 0, high: 9}", "", "search_space.count.type: `count` must be a"),
        ("count: {type: choice, values: [1, a]}", "", "search_space.count.values[1]: `count` must"),
        ("fast: {type: int, low: 0, high: 1}", "", "search_space.fast.type: `fast` must be true"),
        ("wait_time: {type: float, low: 0, high: 1}", "", "search_space.wait_time.type: `wait"),
        (
            "x: {type: choice, values: [1, a]}",
            "parameters: [goal: {position: {x: $x}}]",
            "search.parameters[0].goal: `goal.position.x` must be a number",
        ),
        (
            "x: {type: float, low: 0, high: 1}",
            "variations: [ParameterVariationList: {name: count, values: [$x]}]",
            "search.variations[0].ParameterVariationList.values[0]: `count` must be a whole number",
        ),
    ],
)
def test_values_of_a_search(tmp_path: Path, space: str, more: str, said: str) -> None:
    told = problem(tmp_path, SEARCH.format(space=space, more=more))
    assert f"{said}" in told


def test_a_right_search_is_accepted(tmp_path: Path) -> None:
    space = (
        "count: {type: int, low: 0, high: 9}, speed: {type: int, low: 0, high: 9}, "
        "length_of_way: {type: float, low: 0, high: 9}, fast: {type: bool}, "
        "word: {type: choice, values: [a, 1]}"
    )
    assert load_document(document(tmp_path, SEARCH.format(space=space, more=""))).vast.search


OTHER = """\
from robovast.common.variation import Variation


class Other(Variation):
    def variation(self, in_configs):
        return [self.update_config(c, self.parameters) for c in in_configs]
"""


def test_what_a_variation_type_of_others_leaves_is_checked_at_last(tmp_path: Path) -> None:
    (tmp_path / "other.py").write_text(OTHER)
    entry = "configuration:\n- name: a\n  parameters: [goal: {x: 1}]\n  variations:\n"
    right = "  - other.py:Other: {goal: {position: {x: 1}}}\n"
    (variant,) = expand(load_document(document(tmp_path, entry + right)), tmp_path)
    assert variant.parameters == {"goal": {"position": {"x": 1}}}
    wrong = f"{right}  - other.py:Other: {{count: 2.5}}\n"
    with pytest.raises(InputError) as raised:
        expand(load_document(document(tmp_path, entry + wrong)), tmp_path)
    assert str(raised.value) == (
        f"{tmp_path}/drive.vast: configuration `a-1-1`: `count` must be a whole number, not 2.5; "
        "drive.osc:5 declares `count: int = 3`. Give such values, or change that line."
    )
