"""The compatibility version, and names of campaign folders, for plugins."""

from robovast.model.naming import (
    campaign_folder_name,
    campaign_prefix,
    campaign_time,
    get_campaign,
    get_campaign_timestamp,
    is_campaign_dir,
)

COMPAT_VERSION = 2
"""Version of the interface to run images (docs/reference/container-interface.md)."""

__all__ = [
    "COMPAT_VERSION",
    "campaign_folder_name",
    "campaign_prefix",
    "campaign_time",
    "get_campaign",
    "get_campaign_timestamp",
    "is_campaign_dir",
]
