"""Jobs by the name of their command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from robovast.bags.actions import ActionToCsv
from robovast.bags.behaviors import BehaviorsToCsv
from robovast.bags.job import Job
from robovast.bags.rosout import RosoutToCsv
from robovast.bags.tf import TfToCsv
from robovast.bags.topics import TopicsToCsv
from robovast.bags.video import ImagesToWebm
from robovast.errors import InputError

JOBS: dict[str, type[Job]] = {
    job.command: job
    for job in (TopicsToCsv, TfToCsv, BehaviorsToCsv, ActionToCsv, RosoutToCsv, ImagesToWebm)
}


def job_of(command: str, parameters: Mapping[str, Any]) -> Job:
    """The job of a command of a .vast file.

    Raises:
        InputError: a parameter is missing, unknown or wrong.
    """
    kind = JOBS[command]
    try:
        return kind.model_validate(dict(parameters))
    except ValidationError as error:
        problems = (
            f"{'.'.join(map(str, problem['loc'])) or 'parameters'}: {problem['msg']}"
            for problem in error.errors()
        )
        known = ", ".join(kind.model_fields) or "none"
        raise InputError(f"{command}: {'; '.join(problems)}. Its parameters: {known}.") from None
