"""Makes the Jobs that send notices.

The operator itself speaks to the API server alone; the addresses are those of its users.
"""

from __future__ import annotations

from datetime import timedelta

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.alias_generators import to_camel

from robovast.kubeapi.notice import Order
from robovast.kubeapi.resources import Notification, Scheduling
from robovast.kubeapi.status import CampaignStatus
from robovast_operator.kube.objects import Identity, Object
from robovast_operator.kube.times import now
from robovast_operator.kube.work_queue import WorkQueue
from robovast_operator.pods.jobs import notify_job
from robovast_operator.settings import OperatorSettings
from robovast_operator.status.notices import due, interested, job_suffix, marked, notice


class Notifier:
    """Makes the Jobs of due notices."""

    def __init__(self, queue: WorkQueue, settings: OperatorSettings) -> None:
        self._queue = queue
        self._settings = settings

    def next(self, obj: Object, status: CampaignStatus) -> tuple[CampaignStatus, Object | None]:
        """Return the status with the mark of a due notification, and the Job that sends it."""
        if not (obj.get("spec") or {}).get("notifications"):
            return status, None
        wanted = _wanted(obj)
        moment, identity = now(), Identity.of(obj)
        lasting = timedelta(seconds=self._settings.notify_seconds)
        transition, wait = due(status, wanted.notifications, moment, lasting)
        if wait is not None:
            self._queue.add(identity.key, wait)
        if transition is None:
            return status, None
        order = Order(
            notice=notice(identity, status, transition, moment),
            receivers=interested(transition, wanted.notifications),
        )
        name = identity.child(job_suffix(transition))
        job = notify_job(identity, self._settings, wanted.scheduling, name, order)
        return marked(status, transition), job


class _Wanted(BaseModel):
    """The part of a spec that matters here; other parts may be invalid."""

    model_config = ConfigDict(extra="ignore", alias_generator=to_camel, populate_by_name=True)

    notifications: list[Notification] = []
    scheduling: Scheduling = Scheduling()


def _wanted(obj: Object) -> _Wanted:
    """Return notification targets and scheduling; no targets if the spec cannot be read."""
    try:
        return _Wanted.model_validate(obj.get("spec") or {})
    except ValidationError:
        return _Wanted()
