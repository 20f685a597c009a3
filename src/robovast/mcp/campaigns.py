"""Tools for campaigns, their configurations and their runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from fastmcp import FastMCP

from robovast.base.errors import one_of
from robovast.campaign.failure_groups import FailureGroup, failure_groups
from robovast.campaign.verdict import Verdict
from robovast.evaluation.compare import compare
from robovast.evaluation.configuration_index import default_index
from robovast.evaluation.confined_files import MissingError
from robovast.evaluation.factors import Explanations
from robovast.evaluation.history import history
from robovast.evaluation.library import Library
from robovast.evaluation.rates import IntervalOf, interval_for, sample
from robovast.evaluation.run import read_run
from robovast.evaluation.summaries import RunSummary, VariantRuns
from robovast.mcp.bounds import fitted, page
from robovast.mcp.tools import add_tools

_MOST_VALUES = 20
"""Parameters with more values are not analyzed by value."""


_MOST_CAUSES = 20
_MOST_EFFECTS = 10
_MOST_EXAMPLES = 5
"""Runs of a cause that are named."""
_PATIENCE = 20.0
"""How long campaigns may be searched for one answer [s]."""


class CampaignTools:
    """Campaigns: variations and results."""

    name = "campaigns"

    def __init__(self, library: Library) -> None:
        self._library = library
        self._explanations = Explanations(library)
        self._index = default_index()

    def register(self, mcp: FastMCP) -> None:
        """Add the tools to a server."""
        add_tools(
            mcp,
            self.list_campaigns,
            self.get_campaign,
            self.inspect_campaign,
            self.inspect_campaign_comparison,
            self.list_configurations,
            self.get_configuration,
            self.get_configuration_history,
            self.search_runs,
            self.get_run,
        )

    def list_campaigns(self, offset: int = 0) -> dict[str, Any]:
        """List the campaigns of the results folder, the newest first."""
        return page(self._library.names(), offset, name="campaigns")

    def get_campaign(self, campaign: str) -> Any:
        """Get state, runs by verdict, times [s] and execution of a campaign."""
        summary = self._library.summary(campaign)
        active = self._library.campaign(campaign).active
        return fitted({**asdict(summary), "active_jobs": active or ()})

    def inspect_campaign(self, campaign: str) -> Any:
        """Compute failure rates of a campaign by factor (varied value) and by cause.

        A cause is a reason without the numbers that differ between runs; `numbers` has their
        ranges. Clearly separate groups of a number are separate causes. The rates have 95 %
        intervals and exclude interrupted runs. `explained_by` has the clearest split of each
        factor. `p` is the probability that chance alone causes a split this clear.
        """
        interval_of = interval_for(self._library.summary(campaign))
        variants = self._library.campaign(campaign).variants
        _, explained = self._explanations.of(campaign)
        groups = failure_groups(
            (f"{v.name}/{run.number}", run.verdict, run.reason) for v in variants for run in v.runs
        )
        return fitted(
            {
                "all_runs": _rate(variants, interval_of),
                "by_factor": _by_factor(variants, interval_of),
                "explained_by": [asdict(effect) for effect in explained.effects[:_MOST_EFFECTS]],
                "separate_failures_best": explained.axes,
                "causes": [_cause(group) for group in groups[:_MOST_CAUSES]],
            }
        )

    def inspect_campaign_comparison(self, before: str, after: str) -> Any:
        """Compare two campaigns: changes for the worse or better, and whether chance explains them.

        Configurations with equal parameters are compared by McNemar's exact test where their runs
        have equal seeds, otherwise by Fisher's, with Holm's correction for their number.
        """
        a, b = (self._library.campaign(name).variants for name in (before, after))
        found = compare(a, b)
        changed = [v for v in found.variants if v.change != "same"]
        return fitted(
            {
                "statement": found.statement,
                "changes": Counter(variant.change for variant in found.variants),
                "configurations_that_differ": changed,
                "only_before": found.only_a,
                "only_after": found.only_b,
            }
        )

    def list_configurations(self, campaign: str, offset: int = 0) -> dict[str, Any]:
        """List the configurations of a campaign: factors, failure rates, 95 % intervals."""
        interval_of = interval_for(self._library.summary(campaign))
        items = [
            {
                "configuration": v.name,
                "factors": v.factors,
                "parameters": v.parameters,
                **_rate([v], interval_of),
            }
            for v in self._library.campaign(campaign).variants
        ]
        return page(items, offset, name="configurations")

    def get_configuration(self, campaign: str, configuration: str) -> Any:
        """Get parameters and runs of one configuration of a campaign."""
        variant = self._variant(campaign, configuration)
        return fitted(variant)

    def get_configuration_history(self, campaign: str, configuration: str) -> Any:
        """Get how often a configuration failed in each campaign, the oldest first.

        `changes` lists which inputs differ from the campaign before: image, environment, RoboVAST
        version, seed, parameters, scenario, .vast file, and paths of other files.
        A configuration is recognized by its parameters. With `pending`, ask again: so many
        campaigns could not be searched in time.
        """
        results = self._library.results
        found = history(results, campaign, configuration, self._index, limit=_PATIENCE)
        return fitted(found)

    def search_runs(
        self,
        campaign: str,
        verdict: Verdict | None = None,
        configuration: str = "",
        reason: str = "",
        offset: int = 0,
    ) -> dict[str, Any]:
        """Search the runs of a campaign.

        Args:
            campaign: name of the campaign.
            verdict: only runs with this verdict.
            configuration: only runs of this configuration.
            reason: only runs whose reason has this text, in capitals or not.
            offset: where to continue after a truncated answer.
        """
        needle = reason.casefold()
        found = [
            {"configuration": v.name, "parameters": v.parameters, **asdict(run)}
            for v in self._library.campaign(campaign).variants
            if configuration in ("", v.name)
            for run in v.runs
            if verdict in (None, run.verdict) and needle in run.reason.casefold()
        ]
        return page(found, offset, name="runs")

    def get_run(self, campaign: str, configuration: str, run: int) -> Any:
        """Get a run: record with verdict and reason, failure, logs, files, bags, and the command
        that repeats it.
        """
        variant = self._variant(campaign, configuration)
        _find_run(variant, run)
        return fitted(read_run(self._library.results, campaign, configuration, run))

    def _variant(self, campaign: str, configuration: str) -> VariantRuns:
        for variant in self._library.campaign(campaign).variants:
            if variant.name == configuration:
                return variant
        raise MissingError(
            f"{campaign} has no configuration {configuration}",
            hint="call `list_configurations` to list them",
        )


def _find_run(variant: VariantRuns, number: int) -> RunSummary:
    for run in variant.runs:
        if run.number == number:
            return run
    hint = one_of((run.number for run in variant.runs[:20]), "wait until a run has finished")
    raise MissingError(f"{variant.name} has no run {number}", hint=hint)


def _cause(group: FailureGroup[str]) -> dict[str, Any]:
    return {
        "cause": group.cause,
        "numbers": group.numbers,
        "verdicts": group.verdicts,
        "runs": len(group.runs),
        "examples": group.runs[:_MOST_EXAMPLES],
    }


def _rate(variants: Sequence[VariantRuns], interval_of: IntervalOf) -> dict[str, Any]:
    found = sample(*variants)
    return {
        "runs": found.runs,
        "not_passed": found.bad,
        "interval": interval_of(found.bad, found.runs),
        "median_duration": found.duration,
    }


def _by_factor(variants: Sequence[VariantRuns], interval_of: IntervalOf) -> dict[str, Any]:
    """Failure rates of the values of each factor that has more than one."""
    names = dict.fromkeys(name for variant in variants for name in variant.factors)
    groups = {name: _grouped(variants, name) for name in names}
    return {
        name: [{"value": value, **_rate(members, interval_of)} for value, members in found.items()]
        for name, found in groups.items()
        if 1 < len(found) <= _MOST_VALUES
    }


def _grouped(variants: Sequence[VariantRuns], name: str) -> dict[str, list[VariantRuns]]:
    groups: dict[str, list[VariantRuns]] = {}
    for variant in variants:
        groups.setdefault(str(variant.factors.get(name)), []).append(variant)
    return groups
