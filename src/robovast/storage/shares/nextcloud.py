"""Shares as public links of a Nextcloud server."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import ClassVar

from robovast.base.errors import InputError
from robovast.storage.shares.webdav import WebDavShareProvider

URL = "ROBOVAST_SHARE_URL"

_LINK = re.compile(r"(?P<server>https?://.+?)(/index\.php)?/s/(?P<token>[^/?#]+)/?")


class NextcloudShareProvider(WebDavShareProvider):
    """A public link without a password; it must allow uploading and editing."""

    SHARE_TYPE: ClassVar[str] = "nextcloud"
    PUT_IS_ATOMIC: ClassVar[bool] = True

    def required_env_vars(self) -> dict[str, str]:
        """The link."""
        return {URL: "public link of the folder, as https://cloud.example.org/s/AbCdEf"}

    def address(self) -> tuple[str, str, str]:
        """The link's WebDAV folder, with its token as the user.

        Raises:
            InputError: it is not a public link.
        """
        match = _LINK.fullmatch(os.environ[URL].strip())
        if match is None:
            raise InputError(
                f"{URL} is not a public link of a Nextcloud server",
                hint="copy it from the sharing dialog, as https://cloud.example.org/s/AbCdEf",
            )
        return f"{match['server']}/public.php/webdav/", match["token"], ""

    def remedies(self) -> Mapping[int, str]:
        """Remedies by HTTP status."""
        return {
            401: f"check {URL}: the link may have ended, or have a password",
            403: "let the link allow uploading and editing",
            404: f"check {URL}: the link may have ended",
        }
