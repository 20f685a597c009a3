"""Entries with a design: the configurations that it chooses, named as in the whole product."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import DocumentError, InputError
from robovast.model.document import load_document
from robovast.model.expansion import expand

DOCUMENT = """\
version: 1
metadata: {{name: hall}}
configuration:
- name: hall
  variations:
{variations}
{design}
execution:
  scenario_file: scenario.osc
"""
LISTS = """\
  - ParameterVariationList: {name: a, values: [1, 2, 3]}
  - OneOfVariation: {variations: [ParameterVariationList: {name: b, values: [1, 2]}, \
ParameterVariationList: {name: c, values: [7, 8]}]}
  - ParameterVariationList: {name: [d, e], values: [[1, 2], [3, 4]]}
"""
SCENARIO = "scenario test:\n" + "".join(f"    {name}: int = 0\n" for name in "abcde")


def names(folder: Path, variations: str, design: str = "") -> dict[str, dict[str, object]]:
    """The parameters of the variants of a document, by name."""
    (folder / "scenario.osc").write_text(SCENARIO + "    do serial:\n        wait elapsed(1s)\n")
    path = folder / "hall.vast"
    path.write_text(DOCUMENT.format(variations=variations, design=design and f"  design: {design}"))
    return {v.name: dict(v.parameters) for v in expand(load_document(path), folder)}


@pytest.mark.parametrize(
    ("design", "count"),
    [
        ("{kind: full}", 24),
        ("{kind: pairwise}", 12),
        ("{kind: sobol, count: 8, seed: 2}", 8),
        ("{kind: lhs, count: 5}", 5),
        ("{kind: random, count: 24}", 24),
    ],
)
def test_a_design_chooses_from_the_product_and_names_as_it_does(
    tmp_path: Path, design: str, count: int
) -> None:
    product = names(tmp_path, LISTS)
    chosen = names(tmp_path, LISTS, design)
    assert len(chosen) == count
    assert chosen == {name: product[name] for name in product if name in chosen}
    assert list(chosen) == [name for name in product if name in chosen]


def test_the_product_is_neither_made_nor_counted(tmp_path: Path) -> None:
    variations = "".join(
        f"  - ParameterVariationList: {{name: {name}, values: {list(range(100))}}}\n"
        for name in "abcde"
    )
    assert len(names(tmp_path, variations, "{kind: sobol, count: 50}")) == 50
    with pytest.raises(InputError, match="would have 10,000,000,000 configurations"):
        names(tmp_path, variations, "{kind: full}")
    with pytest.raises(InputError, match="would have 900,000 configurations"):
        names(tmp_path, variations, "{kind: random, count: 900000}")


DRAWN = (
    "  - ParameterVariationDistributionUniform: "
    "{name: a, type: int, num_variations: 3, min: 1, max: 2}"
)
ONE = "  - ParameterVariationList: {name: a, values: [1, 2]}\n"


@pytest.mark.parametrize(
    ("variations", "design", "line", "said"),
    [
        (LISTS, "{kind: random, count: 25}", 10, "larger than the product: 25 of 24 combinations"),
        (DRAWN, "{kind: pairwise}", 7, "`ParameterVariationDistributionUniform` draws its own"),
        (ONE, "{kind: latin, count: 2}", 8, "design.kind: must be"),
        (ONE, "{kind: lhs}", 8, "the key `count` is missing"),
        (ONE, "{kind: full, count: 2}", 8, "remove `count` and `seed`"),
        (ONE, "{kind: lhs, count: 0}", 8, "count"),
        (ONE, "{kind: lhs, count: 1, sed: 1}", 8, "sed"),
        (ONE * 17, "{kind: sobol, count: 3}", 24, "a Sobol design has at most 16 variations"),
        (
            f"  - ParameterVariationList: {{name: a, values: {list(range(400))}}}\n" * 2,
            "{kind: pairwise}",
            9,
            "160,000 pairs of values are more than 100,000",
        ),
    ],
)
def test_a_wrong_design_is_refused_with_its_place(
    tmp_path: Path, variations: str, design: str, line: int, said: str
) -> None:
    with pytest.raises(DocumentError) as raised:
        names(tmp_path, variations, design)
    (problem,) = raised.value.problems
    assert said in str(problem)
    assert f"hall.vast:{line}" in str(problem) or f":{line - 1}:" in str(problem)


def test_a_design_without_variations_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="a design chooses among variations"):
        names(
            tmp_path,
            "  - ParameterVariationList: {name: a, values: [1]}",
            "{kind: full}\n- name: b\n  design: {kind: full}",
        )


def test_a_variation_that_makes_another_number_than_announced_is_named(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "from robovast.common.variation import Variation\n"
        "class Mine(Variation):\n"
        "    @classmethod\n"
        "    def levels(cls, parameters, base_path):\n"
        "        return 3\n"
        "    def variation(self, configs):\n"
        "        return [self.update_config(c, {'a': n}) for c in configs for n in range(2)]\n"
    )
    with pytest.raises(InputError, match="variation 1 created 2 configurations, but its `levels`"):
        names(tmp_path, "  - mine.py:Mine", "{kind: full}")


def test_the_product_of_what_is_chosen_with_the_next_values_is_never_made_at_once(
    tmp_path: Path,
) -> None:
    (tmp_path / "mine.py").write_text(
        "from robovast.common.variation import Variation\n"
        "class Mine(Variation):\n"
        "    @classmethod\n"
        "    def levels(cls, parameters, base_path):\n"
        "        return 200\n"
        "    def variation(self, configs):\n"
        "        assert len(configs) <= 50\n"
        "        return [self.update_config(c, {'b': n}) for c in configs for n in range(200)]\n"
    )
    values = list(range(200))
    both = f"  - ParameterVariationList: {{name: a, values: {values}}}\n  - mine.py:Mine"
    found = names(tmp_path, both, "{kind: lhs, count: 200}")
    assert found == {name: {"a": a - 1, "b": b - 1} for name, a, b in map(numbered, found)}
    assert len(found) == 200


def numbered(name: str) -> tuple[str, int, int]:
    """A name, and the numbers in it."""
    _, first, second = name.split("-")
    return name, int(first), int(second)
