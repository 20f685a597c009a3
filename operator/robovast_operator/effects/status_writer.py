"""Writes statuses, and creates Events of what changed in them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence

from robovast.kubeapi.resources import API_VERSION
from robovast.kubeapi.status import (
    CampaignStatus,
    Condition,
    ConfigurationStatus,
    compact,
    read_status,
)
from robovast_operator.effects.jobs import Jobs
from robovast_operator.effects.notifier import Notifier
from robovast_operator.kube import paths
from robovast_operator.kube.announce import announce
from robovast_operator.kube.api import Api
from robovast_operator.kube.conditions import Found, dated, is_true
from robovast_operator.kube.events import EventContent, messages
from robovast_operator.kube.few_at_once import few_at_once
from robovast_operator.kube.objects import Identity, Key, Object
from robovast_operator.kube.store import Store
from robovast_operator.kube.times import format_time, now
from robovast_operator.kube.work_queue import WorkQueue
from robovast_operator.planning.additions import Additions
from robovast_operator.planning.campaign import Accepted, Rejected, Revision
from robovast_operator.planning.configurations import (
    NOT_ACCEPTED,
    NOT_FOUND,
    ConfigurationStatuses,
    is_own,
    is_owned,
    waiting_status,
)
from robovast_operator.pods.observations import Trouble
from robovast_operator.settings import OperatorSettings
from robovast_operator.status.conditions import (
    composing_conditions,
    failing_conditions,
    is_news,
    rejected_conditions,
)

WINDOW = 60.0
MOST_WRITES = 60
"""Most writes of one Campaign's status within `WINDOW` [s], whatever changes in it."""


class Statuses:
    """Writes changed statuses, at a limited rate."""

    def __init__(
        self,
        api: Api,
        store: Store,
        queue: WorkQueue,
        settings: OperatorSettings,
        notifier: Notifier,
        jobs: Jobs,
        put_off: Callable[[], None],
    ) -> None:
        """
        Args:
            api: the API server.
            store: the objects in memory.
            queue: where a campaign whose write is put off is added again.
            settings: of the installation.
            notifier: decides which notices are sent.
            jobs: creates the Jobs that send them.
            put_off: is called when a changed condition has to wait.
        """
        self._api = api
        self._jobs = jobs
        self._store = store
        self._queue = queue
        self._pause = settings.status_seconds
        self._notifier = notifier
        self._put_off = put_off
        self._written: dict[str, deque[float]] = {}
        """By uid of a Campaign, when its status was last written."""

    async def rejected(
        self,
        obj: Object,
        rejected: Rejected,
        seen: CampaignStatus | None = None,
        *,
        runs_continue: bool = False,
    ) -> None:
        """Write the status of a rejected Campaign.

        Args:
            obj: the Campaign.
            rejected: why.
            seen: its status apart from that, if runs were planned earlier.
            runs_continue: whether any of these runs are not finished.
        """
        old = read_status(CampaignStatus, obj.get("status"))
        now_seen = seen or old
        found = rejected_conditions(
            rejected.reason, rejected.message, now_seen.conditions if runs_continue else ()
        )
        update = {
            "observed_generation": obj["metadata"]["generation"],
            "state": now_seen.state if runs_continue else "Rejected",
            "conditions": _dated(obj, found, old),
        }
        await self.write(obj, now_seen.model_copy(update=update))
        await self.waiting(Identity.of(obj).key, NOT_ACCEPTED)

    async def composing(self, obj: Object, accepted: Accepted, trouble: Trouble | None) -> None:
        """Write the status while only the compose Job runs."""
        old = read_status(CampaignStatus, obj.get("status"))
        status = CampaignStatus(
            observed_generation=obj["metadata"]["generation"],
            state="Expanding",
            campaign=accepted.campaign,
            bucket=accepted.bucket,
            endpoint=accepted.endpoint,
            image=accepted.image,
            notified=old.notified,
            conditions=_dated(obj, composing_conditions(trouble), old),
        )
        await self.write(obj, status)
        await self.waiting(Identity.of(obj).key, NOT_ACCEPTED)

    async def failing(self, obj: Object, trouble: Trouble) -> None:
        """Report why a Campaign cannot be reconciled; keep the rest of the status.

        An Event has the same message, because the API server may reject the status.
        """
        old = read_status(CampaignStatus, obj["status"])
        conditions = _dated(obj, failing_conditions(trouble, old.conditions), old)
        await self.report(Identity.of(obj), trouble, obj["metadata"]["generation"])
        await self.write(obj, old.model_copy(update={"conditions": conditions}))

    async def report(self, identity: Identity, trouble: Trouble, generation: int) -> None:
        """Report what is wrong by an Event, once for each cause and generation."""
        message = EventContent("Warning", trouble.reason, trouble.message, str(generation))
        await announce(self._api, identity, message)

    async def write(
        self, obj: Object, status: CampaignStatus, events: Sequence[EventContent] = ()
    ) -> bool:
        """Write a changed status, and create the Events of the change.

        Args:
            obj: the Campaign.
            status: its status.
            events: in addition to the Events of conditions.

        Returns:
            False if the write is put off.
        """
        old = read_status(CampaignStatus, obj.get("status"))
        status, notice = self._notifier.next(obj, status)
        if status == old:
            return True
        identity = Identity.of(obj)
        wait = self._wait(identity.uid, news=is_news(old, status))
        if wait > 0:
            self._queue.add(identity.key, wait)
            return False
        if notice is not None:
            await self._jobs.create(notice)
        for message in [*events, *messages(old.conditions, status.conditions)]:
            await announce(self._api, identity, message)
        path = f"{paths.campaigns(identity.namespace)}/{identity.name}"
        body = {
            "apiVersion": API_VERSION,
            "kind": "Campaign",
            "metadata": {"name": identity.name, "uid": identity.uid},
            "status": compact(status.model_dump(by_alias=True, exclude_none=True)),
        }
        written = await self._api.apply_status(path, body)
        times = self._written.setdefault(identity.uid, deque(maxlen=MOST_WRITES))
        times.append(time.monotonic())
        if written is not None:
            self._store.put_campaign(written)
        return True

    def _wait(self, uid: str, *, news: bool) -> float:
        """Return how long a write of a Campaign's status must wait [s]."""
        moment = time.monotonic()
        kept = {u: times for u, times in self._written.items() if times[-1] > moment - WINDOW}
        self._written, times = kept, kept.get(uid, deque())
        limited = times[0] + WINDOW - moment if len(times) == MOST_WRITES else 0.0
        if news and limited > 0:
            self._put_off()
        pause = times[-1] + self._pause - moment if times and not news else 0.0
        return max(limited, pause)

    async def configurations(
        self,
        accepted: Accepted,
        revision: Revision,
        status: CampaignStatus,
        additions: Additions,
    ) -> None:
        """Write the Configurations' statuses at the campaign's end.

        Of those that were applied by hand also at their beginning, as they may be wrong. The
        operator's own have one write when they are made, and one at the end.
        """
        identity, ended = accepted.identity, is_true(status, "ResultsAvailable")
        unknown = {item["metadata"]["name"] for item in additions.unknown.values()}
        due = [
            item
            for item in self._store.configurations_of(identity.key)
            if item["metadata"]["name"] not in unknown
            and (ended or not (is_own(item, identity) or _is_current(item)))
        ]
        if due:
            moment = format_time(now())
            statuses = ConfigurationStatuses(revision, status, moment, additions.problems)
            await few_at_once(self._write_configuration_status(i, statuses.of(i)) for i in due)

    async def waiting(self, key: Key, reason: str) -> None:
        """Report in Configurations applied by hand what the Configurations wait for, once each.

        Args:
            key: their Campaign, which may not exist.
            reason: `NOT_FOUND`, or `NOT_ACCEPTED`, which leaves those it has answered as they are.
        """
        moment = format_time(now())
        waiting = [
            (item, waiting_status(item, reason, moment))
            for item in self._store.configurations_of(key)
            if not (is_owned(item) or _is_leaving(item))
            and (reason == NOT_FOUND or not _is_current(item))
        ]
        await few_at_once(
            self._write_configuration_status(item, status)
            for item, status in waiting
            if status is not None
        )

    async def _write_configuration_status(self, item: Object, status: ConfigurationStatus) -> None:
        if status == read_status(ConfigurationStatus, item.get("status")):
            return
        body = compact(status.model_dump(by_alias=True, exclude_none=True))
        meta = item["metadata"]
        path = f"{paths.configurations(meta['namespace'])}/{meta['name']}"
        written = await self._api.apply_status(
            path,
            {
                "apiVersion": API_VERSION,
                "kind": "Configuration",
                "metadata": {"name": meta["name"], "uid": meta["uid"]},
                "status": body,
            },
        )
        if written is not None:
            self._store.put_configuration(written)


def _dated(obj: Object, found: Sequence[Found], old: CampaignStatus) -> list[Condition]:
    """Return conditions with the times since when they hold."""
    return dated(found, obj["metadata"]["generation"], format_time(now()), old.conditions)


def _is_current(item: Object) -> bool:
    """Return whether a Configuration's status describes the current generation."""
    seen = (item.get("status") or {}).get("observedGeneration")
    return bool(seen == item["metadata"].get("generation"))


def _is_leaving(item: Object) -> bool:
    return "deletionTimestamp" in item["metadata"]
