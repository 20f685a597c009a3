"""Minimises a failing run: executes milder and milder parameters, each until it is decided.

The new campaign's folder has a configuration for each step. A step's outcome follows from its
stored runs, and the next step from the outcomes so far, so that a killed minimising that is
continued takes the same way.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from robovast.analysis.minimise.candidates import passing_variants, reductions_of
from robovast.analysis.minimise.record import (
    MinimiseRequest,
    MinimiseStep,
    read_request,
    write_path,
)
from robovast.analysis.minimise.shrinking import Parameters, shrink
from robovast.analysis.minimise.trials import Judged, TrialOutcome, judge
from robovast.base.errors import InputError
from robovast.base.sequential import SequentialTest
from robovast.base.serialization import fingerprint
from robovast.campaign.configurations import read_variants
from robovast.campaign.layout import Layout
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.execution.generate import write_configurations
from robovast.execution.local.campaign import (
    execute_runs,
    executing,
    how,
    stored_runs,
    write_job_links,
)
from robovast.execution.local.events import ExecutionObserver, LocalOptions
from robovast.execution.local.replay import ExecutedRun, begin_campaign, execute_again
from robovast.execution.local.session import Session
from robovast.execution.local.store import storage_errors
from robovast.execution.local.stored_inputs import read_inputs
from robovast.model.expansion import Composition, Variant
from robovast.model.plan import Run, plan_variants
from robovast.model.scenario import scenario_defaults
from robovast.model.seeds import run_seed


class End(StrEnum):
    """Why minimising ended."""

    MINIMAL = "minimal"
    """No single step leads to milder parameters that still fail."""
    BUDGET = "budget"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class Minimised:
    """A failing run, and the mildest parameters that were found to fail, too."""

    campaign: Path
    """Folder of the new campaign."""
    request: MinimiseRequest
    steps: tuple[MinimiseStep, ...]
    end: End

    @property
    def best(self) -> MinimiseStep | None:
        """The mildest one that still fails; None if nothing is decided yet."""
        return next((step for step in reversed(self.steps) if step.is_kept), None)


def minimise_run(
    run: ExecutedRun,
    output: Path,
    test: SequentialTest,
    budget: int,
    options: LocalOptions,
    observer: ExecutionObserver,
) -> Minimised:
    """Minimise a run that failed, in a new campaign's folder below `output`.

    Args:
        run: the run; it stays as it is.
        output: folder for the campaign's folder.
        test: tells a failure that is still there (`broken`) from one that is not.
        budget: executed runs after which no further step begins.
        options: how it is executed.
        observer: receives events.

    Raises:
        InputError: the run did not fail, nothing can be milder, or it does not fail again.
        CannotRunError: the runtime is not usable, or the image is gone.
        StorageError: `output` cannot be written.
    """
    _refuse_verdict(run)
    again = execute_again(run, options, observer.message)
    defaults = scenario_defaults(again.document.scenario)
    request = MinimiseRequest(
        run=run.full_path,
        seed=run.record.seed,
        cause=run.record.reason,
        test=test,
        reductions=tuple(reductions_of(run.variant, _passing(run), defaults)),
    )
    if not request.reductions:
        raise InputError(
            f"{run.folder}: has no parameter to reduce",
            hint="use a run with a list, or with a number, choice or switch that has a "
            "different value in a passing configuration or in the scenario's defaults",
        )
    session = begin_campaign(again, output, "minimise", test.most or 1, test)
    with storage_errors(session.layout.root):
        write_path(session.layout, request, [])
    return _minimise(session, request, budget, observer)


def continue_minimising(
    run: ExecutedRun,
    campaign: Path,
    budget: int,
    options: LocalOptions,
    observer: ExecutionObserver,
) -> Minimised:
    """Continue what was interrupted or has used up its budget; see `minimise_run`.

    Raises:
        InputError: the folder does not minimise this run.
    """
    layout = Layout(campaign.absolute())
    request = read_request(layout)
    if request.run != run.full_path or not request.fits(run.variant.parameters):
        raise InputError(
            f"{campaign}: reduces {request.run}, not {run.full_path} as it is in {run.folder}.",
            hint="name the run that the folder reduces, or start again without `--resume`",
        )
    _refuse_other_steps(run, layout)
    session = execute_again(run, options, observer.message).session(layout)
    return _minimise(session, request, budget, observer)


def _refuse_other_steps(run: ExecutedRun, layout: Layout) -> None:
    """Refuse a folder whose configurations are not those that this module has made for a run."""
    read_inputs(layout, run.variant.name)
    own, (first, *others) = run.variant, read_variants(layout)
    names = [variant.name for variant in (first, *others)]
    right = [own.name, *(f"{own.name}-m{number}" for number in range(1, len(names)))]
    files = [[file.name for file in variant.files] for variant in (own, first, *others)]
    same = fingerprint(first.parameters) == fingerprint(own.parameters)
    if names != right or not same or any(found != files[0] for found in files):
        raise InputError(
            f"{layout.configurations}: was edited: its configurations are not the steps of "
            f"reducing {run.full_path}",
            hint="restore the file, or start again without `--resume`",
        )


def _refuse_verdict(run: ExecutedRun) -> None:
    verdict = run.record.verdict
    if verdict is Verdict.PASSED:
        raise InputError(
            f"{run.folder}: passed, so there is no failure to reduce", hint="name a failed run"
        )
    if verdict is not Verdict.FAILED:
        raise InputError(
            f"{run.folder}: {verdict} ({run.record.reason}), so the run does not show a fault of "
            "the robot",
            hint="name a failed run. To check whether this run errors again, use `vast replay`",
        )


def _passing(run: ExecutedRun) -> Sequence[Variant]:
    return [v for v in passing_variants(run.layout) if v.name != run.variant.name]


class _EndedError(Exception):
    """Nothing more is to be executed."""

    def __init__(self, end: End) -> None:
        self.end = end


def _minimise(
    session: Session, request: MinimiseRequest, budget: int, observer: ExecutionObserver
) -> Minimised:
    with executing(session, observer) as observer:
        way = _Way(session, request, budget, observer)
        way.open()
        end = End.MINIMAL
        try:
            way.check_first()
            shrink(way.variants[0].parameters, request.reductions, way.fails)
        except _EndedError as ended:
            end = ended.end
        way.write(end)
    return Minimised(session.layout.root, request, tuple(way.steps), end)


@dataclass
class _Way:
    """The steps of a minimising, within `executing`."""

    session: Session
    request: MinimiseRequest
    budget: int
    observer: ExecutionObserver
    variants: list[Variant] = field(default_factory=list)
    records: dict[int, RunRecord] = field(default_factory=dict)
    """Of all runs that are stored, by id."""
    steps: list[MinimiseStep] = field(default_factory=list)
    _known: dict[str, Judged] = field(default_factory=dict)
    """By the parameters' fingerprint."""

    def open(self) -> None:
        """Read what is stored."""
        layout = self.session.layout
        self.variants = read_variants(layout)
        runs = [run for variant in self.variants for run in self._runs(variant)]
        self.records = stored_runs(self.session, runs, self.observer)
        runtime = how(self.session, self.session.options.jobs or 1)
        self.observer.campaign_started(layout.root, len(self.records), len(self.records), runtime)

    def check_first(self) -> None:
        """Refuse a run that does not fail again.

        Raises:
            InputError: it does not.
        """
        own = self.variants[0].parameters
        if self.fails(own):
            return
        first = self._known[fingerprint(own)]
        often = f"{first.failed} of {first.runs} runs failed so"
        why = f"{first.outcome}: {first.reason}" if first.reason else first.outcome
        raise InputError(
            f"{self.request.run}: the failure is too rare to be reduced: {often} with its "
            f"parameters, the first with its seed ({why})",
            hint="lower `--bad` and `--good` for rare failures. To check whether the run is "
            "nondeterministic, use `vast replay --times 10`",
        )

    def fails(self, parameters: Parameters) -> bool:
        """Whether parameters still fail; executes as many of their runs as that takes."""
        key = fingerprint(parameters)
        if key not in self._known:
            variant = self._variant(key, parameters)
            self._known[key] = judged = self._decide(variant)
            changes = self.request.changes(self.variants[0].parameters, parameters)
            self.steps.append(MinimiseStep(variant.name, changes, judged, parameters))
            self.write(None)
            self.observer.message(f"{self.steps[-1]}")
        return self._known[key].outcome is TrialOutcome.FAILS

    def write(self, end: End | None) -> None:
        """Record the way so far."""
        with storage_errors(self.session.layout.root):
            write_path(self.session.layout, self.request, self.steps, end)

    def _variant(self, key: str, parameters: Parameters) -> Variant:
        """The configuration of a step, which is made if it is new."""
        known = (v for v in self.variants if fingerprint(v.parameters) == key)
        if (found := next(known, None)) is not None:
            return found
        self._check_budget()
        layout, first = self.session.layout, self.variants[0]
        made = dataclasses.replace(
            first,
            name=f"{first.name}-m{len(self.variants)}",
            parameters=parameters,
            factors=self.request.factors(parameters),
        )
        with storage_errors(layout.root):
            write_configurations(
                self.session.document,
                Composition((made,)),
                layout.root,
                timings=True,
                earlier=self.variants,
                lasting=True,
            )
        self.variants.append(made)
        return made

    def _check_budget(self) -> None:
        if len(self.records) >= self.budget:
            raise _EndedError(End.BUDGET)

    def _decide(self, variant: Variant) -> Judged:
        runs = self._runs(variant)
        while (judged := self._judged(runs)).further:
            self._check_budget()
            number = max(judged.further, self.session.options.jobs or 1)
            self._execute(runs[judged.runs :][:number])
        return judged

    def _judged(self, runs: Sequence[Run]) -> Judged:
        return judge(self.request.test, self.request.cause, list(self._stored(runs)))

    def _stored(self, runs: Sequence[Run]) -> Iterator[RunRecord]:
        for run in runs:
            if run.id not in self.records:
                return
            yield self.records[run.id]

    def _execute(self, runs: Sequence[Run]) -> None:
        self.observer.runs_added(sum(run.id not in self.records for run in runs))
        plan = plan_variants(self.variants, self._most)
        self.records, interrupted = execute_runs(
            self.session, plan, runs, self.records, self.observer
        )
        write_job_links(self.session.layout, self.records)
        if interrupted:
            raise _EndedError(End.INTERRUPTED)

    @property
    def _most(self) -> int:
        """Runs of a step at most."""
        return self.request.test.most or 1

    def _runs(self, variant: Variant) -> list[Run]:
        """The runs of a step: each step has the same seeds, the failing run's own first."""
        own, first = self.request.seed, self.variants[0].name
        place = next(i for i, known in enumerate(self.variants) if known.name == variant.name)
        return [
            Run(place * self._most + n, variant, n, run_seed(own, first, n) if n else own)
            for n in range(self._most)
        ]
