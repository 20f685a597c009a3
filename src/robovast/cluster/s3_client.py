"""The `minio` client, set up to repeat what fails on the way."""

from __future__ import annotations

import os
from typing import Any

import certifi
import urllib3
from minio import Minio

from robovast.cluster.endpoint import Credentials, Endpoint
from robovast.pauses import BUSY, FIRST_PAUSE, LONGEST_PAUSE

MOST_RETRIES = 6
"""How often one request is repeated as it is: its signature holds for some minutes only."""


def connect(
    endpoint: Endpoint,
    credentials: Credentials,
    pool: type[urllib3.PoolManager],
    patience: float,
    connections: int,
) -> Minio:
    """A client that several threads may share.

    Args:
        endpoint: the server.
        credentials: the account.
        pool: kind of the connections.
        patience: for how long to repeat a request [s]; about 30 s at most.
        connections: how many are kept.
    """
    return Minio(
        endpoint.host,
        access_key=credentials.access_key,
        secret_key=credentials.secret_key,
        secure=endpoint.secure,
        region=endpoint.region,
        http_client=pool(
            timeout=urllib3.Timeout(connect=5, read=60),
            maxsize=connections,
            ca_certs=os.environ.get("SSL_CERT_FILE") or certifi.where(),
            retries=_retries(patience),
        ),
    )


class CreateOnly(urllib3.PoolManager):
    """Adds to every upload the condition that the object is new.

    The `minio` client has no option for it; a header that is not Amazon's needs no signature.
    """

    def urlopen(self, method: str, url: str, **options: Any) -> Any:  # type: ignore[override]
        """Send a request."""
        if method == "PUT":
            options["headers"].add("If-None-Match", "*")
        return super().urlopen(method, url, **options)


def _retries(patience: float) -> urllib3.Retry:
    """Repeated by itself, a part of a large file does not cost the parts before it."""
    number = 0
    while number < MOST_RETRIES and FIRST_PAUSE * 2 ** (number + 1) <= patience:
        number += 1
    return urllib3.Retry(
        total=number,
        backoff_factor=FIRST_PAUSE,
        backoff_max=LONGEST_PAUSE,
        backoff_jitter=FIRST_PAUSE,
        status_forcelist=BUSY,
        allowed_methods=None,
        raise_on_status=False,
    )
