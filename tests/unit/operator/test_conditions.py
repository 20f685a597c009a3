"""What of a status is told at once."""

from __future__ import annotations

from robovast.kubeapi.status import CampaignStatus, Condition, Runs
from robovast_operator.kube.conditions import dated
from robovast_operator.status.conditions import is_news, rejected_conditions


def after(passed: int, failed: int = 0, errored: int = 0) -> CampaignStatus:
    """A campaign of 500 runs of which so many have a verdict."""
    runs = Runs(total=500, passed=passed, failed=failed, errored=errored)
    return CampaignStatus(state="Running", runs=runs)


def test_numbers_can_wait() -> None:
    assert not is_news(after(10), after(499))


def test_the_last_verdict_is_told_at_once_whatever_it_is() -> None:
    assert is_news(after(499), after(500))
    assert is_news(after(490, 9), after(490, 9, 1))
    assert not is_news(after(500), after(500))


def test_no_condition_says_who_a_url_names() -> None:
    found = rejected_conditions("Invalid", "Source https://bot:ghp_1@git.org/a@b is missing.")
    told = dated(found, 1, "2026-01-01T00:00:00Z", ())
    assert told[0].message == "Source https://git.org/a@b is missing."


def test_a_rejected_edit_keeps_the_conditions_of_runs_that_continue() -> None:
    before = [
        Condition(type=kind, status="True", reason="Running", message="3 of 20 runs")
        for kind in ("Accepted", "Reconciling", "Stalled", "QuotaReserved")
    ]
    found = {
        kind: (status, why) for kind, status, why, _ in rejected_conditions("Bad", "m", before)
    }
    assert found["Accepted"] == ("False", "Bad")
    assert found["Stalled"] == ("True", "Bad")
    assert found["Reconciling"] == ("True", "Running")
    assert found["QuotaReserved"] == ("True", "Running")
