"""`purge`: remove a campaign's results."""

from __future__ import annotations

from robovast.agent.campaign import open_campaign
from robovast.agent.exit_codes import AgentExit
from robovast.agent.folders import Folders


def purge(folders: Folders) -> AgentExit:
    """Remove the campaign's bucket with all that is in it.

    Raises:
        StorageError: it cannot be removed.
    """
    campaign = open_campaign(folders)
    campaign.store.delete_bucket(campaign.plan.bucket)
    return AgentExit.PASSED
