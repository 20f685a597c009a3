"""Maps bag commands to the classes that execute them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robovast.analysis.bags.actions import ActionWorker
from robovast.analysis.bags.behaviors import BehaviorsWorker
from robovast.analysis.bags.job import Context, JobWorker
from robovast.analysis.bags.rosout import RosoutWorker
from robovast.analysis.bags.tf import TfWorker
from robovast.analysis.bags.topics import TopicsWorker
from robovast.analysis.bags.video import VideoWorker
from robovast.model.document.commands import (
    ActionToCsv,
    BagCommand,
    BehaviorsToCsv,
    ImagesToWebm,
    RosoutToCsv,
    TfToCsv,
    TopicsToCsv,
)

WORKERS: dict[type[BagCommand], Callable[[Context, Any], JobWorker]] = {
    TopicsToCsv: TopicsWorker,
    TfToCsv: TfWorker,
    BehaviorsToCsv: BehaviorsWorker,
    ActionToCsv: ActionWorker,
    RosoutToCsv: RosoutWorker,
    ImagesToWebm: VideoWorker,
}


def start(job: BagCommand, context: Context) -> JobWorker:
    """Create a worker for a bag.

    Raises:
        CannotRunError: a required package is not installed.
    """
    return WORKERS[type(job)](context, job)
