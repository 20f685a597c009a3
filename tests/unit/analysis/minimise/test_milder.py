"""What could be milder: towards configurations that pass, else the scenario's defaults."""

from __future__ import annotations

from typing import Any

from robovast.analysis.minimise.candidates import reductions_of
from robovast.analysis.minimise.shrinking import Items, Ladder
from robovast.model.variant import ConfigFile, Variant


def variant(name: str, *files: str, **parameters: Any) -> Variant:
    return Variant(name, "hall", parameters, tuple(ConfigFile(f, f) for f in files))  # type: ignore[arg-type]


def test_values_are_those_of_the_nearest_configuration_that_passes_with_another_one() -> None:
    own = variant("own", speed=1.2, margin=0.02, boxes=[1, 2], level=5, gentle=False)
    near = variant("near", speed=1.2, margin=0.1, boxes=[1, 2], level=5, gentle=False)
    far = variant("far", speed=0.4, margin=0.5, boxes=[], level=2, gentle=True)
    items, gentle, speed, margin, level = reductions_of(own, [far, near], {})
    assert items == Items("boxes")
    assert gentle == Ladder("gentle", (True, False))
    assert isinstance(margin, Ladder)
    assert isinstance(speed, Ladder)
    assert margin.values[:2] == (0.1, 0.095)
    assert margin.values[-1] == 0.02
    assert speed.values[0] == 0.4
    assert level == Ladder("level", (2, 3, 4, 5))


def test_without_one_that_passes_it_is_the_default() -> None:
    own = variant("own", speed=1.2, traffic="-3 4", level=10**400, same=3, text="x")
    defaults = {"speed": 0.8, "traffic": "", "level": 1, "same": 3, "text": None}
    traffic, speed = reductions_of(own, [], defaults)
    assert traffic == Ladder("traffic", ("", "-3 4"))
    assert speed.values[0] == 0.8  # type: ignore[union-attr]


def test_structures_and_files_of_configurations_stay() -> None:
    own = variant("own", "maps/a.yaml", map_file="maps/a.yaml", start={"x": 1.0}, empty=[])
    other = variant("other", "maps/b.yaml", map_file="maps/b.yaml", start={"x": 2.0}, empty=[1])
    assert reductions_of(own, [other], {"map_file": "maps/b.yaml"}) == []


def test_numbers_too_close_to_be_divided_have_two_steps() -> None:
    own = variant("own", x=5e-324, y=2.0)
    x, y = reductions_of(own, [variant("other", x=0.0, y=1)], {})
    assert x == Ladder("x", (0.0, 5e-324))
    assert y.values[1] == 1.0625  # type: ignore[union-attr]
