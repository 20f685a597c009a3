"""Reports on notices and uploads: what did not arrive, and what has arrived."""

from __future__ import annotations

from collections.abc import Iterable

from robovast_operator.effects.diagnose import Diagnosis
from robovast_operator.kube.announce import announce
from robovast_operator.kube.api import Api
from robovast_operator.kube.events import EventContent
from robovast_operator.kube.objects import Identity
from robovast_operator.kube.sentences import clause, with_remedy
from robovast_operator.kube.store import NOTIFY_ROLE, JobState
from robovast_operator.pods.pod_status import last_message, last_messages


class Deliveries:
    """Creates Events about notices and uploads."""

    def __init__(self, api: Api, diagnosis: Diagnosis) -> None:
        self._api = api
        self._diagnosis = diagnosis

    async def report(
        self, identity: Identity, jobs: Iterable[JobState], reported: set[str]
    ) -> None:
        """Report once each notice that did not reach all receivers, and the end of each upload."""
        for job in jobs:
            if job.open or job.uid in reported:
                continue
            message = await self._message(job)
            if message is not None:
                await announce(self._api, identity, message)
            reported.add(job.uid)

    async def _message(self, job: JobState) -> EventContent | None:
        failed, notice = job.finished == "Failed", job.role == NOTIFY_ROLE
        if notice and not failed:
            return None
        pods = [pod async for pod in self._diagnosis.pods_of(job)] if failed else []
        if notice:
            causes = last_messages(pods, job.role, job.failed) or [job.message]
            message = with_remedy(
                "A notification could not be sent", "\n".join(causes), "Check spec.notifications."
            )
            return EventContent("Warning", "NotificationFailed", message, job.uid)
        if failed:
            cause = last_message(pods, job.role) or job.message
            message = (
                f"The results could not be uploaded to the file share: {clause(cause)}. Check the "
                "Secret of spec.share."
            )
            return EventContent("Warning", "UploadFailed", message, job.uid)
        message = "The results are uploaded to the file share."
        return EventContent("Normal", "Uploaded", message, job.uid)
