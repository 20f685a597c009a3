"""The S3 server that the environment names, which is reached without a cluster."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from robovast.base.backoff import REPEATABLE

if TYPE_CHECKING:
    from robovast.storage.s3 import ObjectStore

ENDPOINT = "ROBOVAST_S3_ENDPOINT"
ACCESS_KEY = "ROBOVAST_S3_ACCESS_KEY"
SECRET_KEY = "ROBOVAST_S3_SECRET_KEY"  # noqa: S105 - the name of a variable

CONNECTIONS = 16


def given_store() -> ObjectStore | None:
    """The store that the environment names: an address and the keys of an account.

    None if it does not name all of them.
    """
    address, *keys = (os.environ.get(name, "") for name in (ENDPOINT, ACCESS_KEY, SECRET_KEY))
    if not address or not all(keys):
        return None
    from robovast.storage.endpoint import Credentials, Endpoint
    from robovast.storage.s3 import ObjectStore

    credentials = Credentials(*keys)
    return ObjectStore(
        Endpoint.parse(address), credentials, patience=REPEATABLE, connections=CONNECTIONS
    )
