"""Exit codes of our containers, and which of them call for another attempt."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum

from robovast.base.errors import CannotRunError, InputError, RefusedError, RobovastError
from robovast.campaign.verdict import Verdict
from robovast.storage.bucket_ownership import OtherOwnerError


class AgentExit(IntEnum):
    """Exit codes (docs/contributing/agent.md)."""

    PASSED = 0
    """Everything is done, and every run of the pod passed."""
    FAILED = 10
    """Everything is stored; some runs failed, none errored."""
    ERRORED = 11
    """Everything is stored; some runs errored."""
    BAD_PLAN = 64
    """The plan is none of this version: trying again is useless."""
    BAD_DOCUMENT = 65
    """The document or its files are wrong: trying again is useless."""
    OTHER_OWNER = 73
    """The bucket belongs to another campaign: trying again is useless."""
    STORAGE = 74
    """Storage, or the pod's own disk, gave up: try again."""
    RUNS_LEFT = 75
    """Some runs were not executed to their end: try again."""
    REFUSED_AT_START = 76
    """The S3 server refuses for good, before any run: it would refuse every other pod, too."""
    REFUSED = 77
    """The S3 server refuses for good: trying again is useless."""


VERDICTS = frozenset({AgentExit.PASSED, AgentExit.FAILED, AgentExit.ERRORED})
"""Codes with which everything is done and stored."""

USELESS = (
    *(AgentExit.BAD_PLAN, AgentExit.BAD_DOCUMENT, AgentExit.OTHER_OWNER),
    *(AgentExit.REFUSED_AT_START, AgentExit.REFUSED),
)
"""Codes with which another pod would end, too."""


class PlanError(RobovastError):
    """The plan has another version, or lacks what is asked for."""


class KilledError(RobovastError):
    """A process of ours was killed before it had done its work."""


def exit_code_of_error(error: Exception) -> AgentExit:
    """The exit code for a command's exception."""
    if isinstance(error, PlanError):
        return AgentExit.BAD_PLAN
    if isinstance(error, KilledError):
        return AgentExit.RUNS_LEFT
    if isinstance(error, InputError | CannotRunError):
        return AgentExit.BAD_DOCUMENT
    if isinstance(error, OtherOwnerError):
        return AgentExit.OTHER_OWNER
    return AgentExit.REFUSED if isinstance(error, RefusedError) else AgentExit.STORAGE


def exit_code_of(verdicts: Iterable[Verdict]) -> AgentExit:
    """The exit code of a pod whose runs are all stored."""
    found = set(verdicts)
    if Verdict.ERRORED in found:
        return AgentExit.ERRORED
    return AgentExit.FAILED if Verdict.FAILED in found else AgentExit.PASSED


NEVER_STARTED = frozenset({"StartError", "ContainerCannotRun"})
"""What Kubernetes says of the end of a container that could not be started."""
