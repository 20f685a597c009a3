"""Which configurations count for which entry, and which drawn values."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import InputError
from robovast.campaign.verdict import Verdict
from robovast.evaluation.coverage import campaign_coverage
from robovast.evaluation.summaries import RunSummary, VariantRuns
from robovast.model.document import Document, load_document

DOCUMENT = """\
version: 1
configuration:
- name: hall
  variations:
  - {kind}: {{name: a, num_variations: 3, min: 0, max: 1, seed: 1}}
  - {kind}: {{name: b, num_variations: 3, min: 0, max: 1, seed: 2}}
- name: hall-5
  variations:
  - {kind}: {{name: a, num_variations: 3, min: 9, max: 10, seed: 1}}
execution: {{scenario_file: scenario.osc}}
"""
SCENARIO = "scenario test:\n    a: float = 1.0\n    b: float = 1.0\n    do serial:\n"


def document(folder: Path) -> Document:
    """Two entries, of which one has the name of the other and a number."""
    (folder / "scenario.osc").write_text(SCENARIO + "        wait elapsed(1s)\n")
    path = folder / "hall.vast"
    path.write_text(DOCUMENT.format(kind="ParameterVariationDistributionUniform"))
    return load_document(path)


def passed(name: str, entry: str, **parameters: float) -> VariantRuns:
    """A configuration with one run."""
    return VariantRuns(name, entry, parameters, (RunSummary(0, Verdict.PASSED, "", None, None),))


OWN = passed("hall-1-1", "hall", a=0.1, b=0.2), passed("hall-2-1", "hall", a=0.9, b=0.9)


def test_a_configuration_counts_for_its_own_entry_alone(tmp_path: Path) -> None:
    other = passed("hall-5-1", "hall-5", a=9.5, b=0.3)
    hall, five = campaign_coverage(document(tmp_path), [*OWN, other], buckets=2)
    assert (set(hall.counts), set(five.counts)) == ({(0, 0), (1, 1)}, {(0,)})


def test_a_configuration_whose_entry_is_not_known_counts_by_its_name(tmp_path: Path) -> None:
    unknown = passed("hall-3-3", "hall-3-3", a=0.1, b=0.9)
    other = passed("hall-5-1", "hall-5", a=9.5)
    hall, _ = campaign_coverage(document(tmp_path), [*OWN, unknown, other], buckets=2)
    assert set(hall.counts) == {(0, 0), (1, 1), (0, 1)}


@pytest.mark.parametrize(
    "value", [float("nan"), float("inf"), -1.7e308, 10**400], ids=["nan", "inf", "least", "huge"]
)
def test_values_that_cannot_be_divided_are_an_error_in_words(tmp_path: Path, value: float) -> None:
    largest = passed("hall-3-3", "hall", a=1.7e308, b=0.9)
    odd = passed("hall-3-2", "hall", a=value, b=0.9)
    with pytest.raises(InputError, match="`a` of `hall` must be a finite number"):
        campaign_coverage(document(tmp_path), [largest, odd], buckets=5)
