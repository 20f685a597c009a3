"""What executes each of the commands for bags."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robovast.bags.actions import ActionWorker
from robovast.bags.behaviors import BehaviorsWorker
from robovast.bags.job import Context, Worker
from robovast.bags.rosout import RosoutWorker
from robovast.bags.tf import TfWorker
from robovast.bags.topics import TopicsWorker
from robovast.bags.video import VideoWorker
from robovast.document.commands import (
    ActionToCsv,
    BagCommand,
    BehaviorsToCsv,
    ImagesToWebm,
    RosoutToCsv,
    TfToCsv,
    TopicsToCsv,
)

WORKERS: dict[type[BagCommand], Callable[[Context, Any], Worker]] = {
    TopicsToCsv: TopicsWorker,
    TfToCsv: TfWorker,
    BehaviorsToCsv: BehaviorsWorker,
    ActionToCsv: ActionWorker,
    RosoutToCsv: RosoutWorker,
    ImagesToWebm: VideoWorker,
}


def start(job: BagCommand, context: Context) -> Worker:
    """Begin to work on a bag.

    Raises:
        CannotRunError: what the command needs is not installed.
    """
    return WORKERS[type(job)](context, job)
