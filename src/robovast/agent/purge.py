"""`purge`: remove a campaign's results."""

from __future__ import annotations

from robovast.agent.campaign import open_campaign
from robovast.agent.mounts import Folders
from robovast.kubeapi.pod_contract.exit_codes import AgentExit
from robovast.storage.bucket_ownership import OtherOwnerError


def purge(folders: Folders) -> AgentExit:
    """Remove the campaign's bucket with all that is in it; another campaign's stays.

    Raises:
        StorageError: it cannot be removed.
    """
    try:
        open_campaign(folders).bucket.remove()
    except OtherOwnerError as error:  # so nothing there is this campaign's
        print(f"nothing is removed: {error}")  # noqa: T201
    return AgentExit.PASSED
