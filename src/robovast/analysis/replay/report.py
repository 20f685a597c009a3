"""What replays of a run tell: whether its harness is flaky, and whether its robot is chancy."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from robovast.analysis.replay.outputs import ALL_TABLES, OutputComparison, compare_outputs
from robovast.campaign.layout import Layout
from robovast.campaign.run_record import RunRecord, read_run_record
from robovast.campaign.verdict import Verdict
from robovast.model.document.execution import Output


@dataclass(frozen=True)
class Replayed:
    """One replay, beside the run that it repeats."""

    folder: Path
    verdict: Verdict
    reason: str
    outputs: OutputComparison
    is_as_before: bool
    """Whether verdict and outputs are those of the run."""
    is_as_first: bool
    """Whether verdict and outputs are those of the first replay."""


@dataclass(frozen=True)
class ReplayReport:
    """A run and its replays."""

    run: str
    """`<variant>/<number>`."""
    seed: int | None
    verdict: Verdict
    replays: tuple[Replayed, ...]
    other_seeds: Counter[Verdict]
    """Verdicts of the variant's other runs in the campaign, which have seeds of their own."""

    @property
    def differs(self) -> bool:
        """Whether a replay had another result than the run."""
        return not all(replay.is_as_before for replay in self.replays)

    @property
    def flaky(self) -> bool | None:
        """Whether one seed gave several results; None when that cannot be told."""
        if self.seed is None or len(self.replays) < 2:
            return None
        return not all(replay.is_as_first for replay in self.replays)

    @property
    def chancy(self) -> bool | None:
        """Whether other seeds gave another verdict; None when that cannot be told."""
        if self.flaky is not False or not self.other_seeds:
            return None
        return set(self.other_seeds) != {self.verdict}


def report_replays(
    run: Path, replays: Sequence[Path], outputs: Sequence[Output] | None
) -> ReplayReport:
    """Compare a run with its replays, and these with each other.

    Args:
        run: folder of the run.
        replays: folders of the replays, each with its record.
        outputs: what to compare beside verdicts; all tables when None.

    Raises:
        CannotRunError: messages are to be compared without the extra `ros`.
    """
    chosen = ALL_TABLES if outputs is None else outputs
    record, *records = (_record(folder) for folder in (run, *replays))
    return ReplayReport(
        run=f"{run.parent.name}/{run.name}",
        seed=record.seed,
        verdict=record.verdict,
        replays=tuple(
            Replayed(
                folder=folder,
                verdict=now.verdict,
                reason=now.reason,
                outputs=(found := compare_outputs(run, folder, chosen)),
                is_as_before=now.verdict is record.verdict and not found.differences,
                is_as_first=now.verdict is records[0].verdict
                and not compare_outputs(replays[0], folder, chosen).differences,
            )
            for folder, now in zip(replays, records, strict=True)
        ),
        other_seeds=_other_seeds(run, record.seed),
    )


def _record(folder: Path) -> RunRecord:
    record = read_run_record(folder)
    assert record is not None, f"{folder} was found, or written, by the caller"  # noqa: S101
    return record


def _other_seeds(run: Path, seed: int | None) -> Counter[Verdict]:
    """Verdicts of the variant's runs with other seeds, as far as they have one."""
    folders = Layout(run.parent.parent).run_folders_of(run.parent.name)
    records = (read_run_record(folder) for folder in folders)
    return Counter(
        record.verdict
        for record in records
        if record is not None
        and record.seed not in {None, seed}
        and record.verdict in {Verdict.PASSED, Verdict.FAILED}
    )
