"""What is planned is read back as it was recorded, up to the most runs that a campaign can have."""

from __future__ import annotations

import pytest

from robovast.base.errors import InputError
from robovast.campaign.planned_runs import PlannedRuns, planned_runs
from robovast.evaluation.launch.commands import read_choices
from robovast.model.packs import RUNS_LIMIT


def test_as_many_runs_as_a_campaign_can_have_are_read_back() -> None:
    for runs in (1, 1_000_000, RUNS_LIMIT):
        planned = PlannedRuns(runs)
        assert planned_runs(planned.record()) == planned
    more = PlannedRuns(2, {"hall-1": RUNS_LIMIT - 2})
    assert planned_runs(more.record()) == more


def test_a_number_of_runs_that_no_campaign_can_have_is_none() -> None:
    for invalid in (RUNS_LIMIT + 1, 0, -1, True, "5", 5.0, None):
        assert planned_runs({"runs": invalid}).each == 0


def test_the_page_asks_for_as_many() -> None:
    assert read_choices({"runs": str(RUNS_LIMIT)}).runs == RUNS_LIMIT
    for invalid in (str(RUNS_LIMIT + 1), "0", "-1", "9" * 5000):
        with pytest.raises(InputError, match=f"a number from 1 to {RUNS_LIMIT}"):
            read_choices({"runs": invalid})
