"""Faults of an S3 server: which pass by themselves, and what to tell."""

from __future__ import annotations

import time
from calendar import timegm
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from email.utils import parsedate
from typing import TypeVar

from minio.error import InvalidResponseError, MinioException, S3Error, ServerError
from urllib3.exceptions import HTTPError, MaxRetryError, SSLError

from robovast.base.backoff import BUSY, Pauses
from robovast.base.errors import RefusedError, StorageError

T = TypeVar("T")


class ObjectError(StorageError):
    """One object is not what it should be; that says nothing of the others."""


CLOCKS_APART = 600
"""So much, and servers may refuse what is asked; most allow 15 minutes [s]."""
_SKEWED = "RequestTimeTooSkewed"
_PASSING = frozenset(
    {
        "BadDigest",  # damaged on the way
        "ConditionalRequestConflict",
        "IncompleteBody",
        "InternalError",
        "NoSuchUpload",  # a restart forgot the parts of a large file
        "OperationAborted",
        _SKEWED,  # it waited for too long, or a clock is wrong
        "RequestTimeout",
        "ServiceUnavailable",
        "SlowDown",
        "SlowDownRead",
        "SlowDownWrite",
        "XAmzContentChecksumMismatch",
        "XAmzContentSHA256Mismatch",
        "XMinioServerNotInitialized",
    }
)


def persist(action: Callable[[], T], patience: float) -> T:
    """The result of `action`, which is repeated while its fault may pass by itself.

    Args:
        action: does the same however often it is called.
        patience: for how long to repeat it [s].

    Raises:
        MinioException: the last fault, also urllib3's `HTTPError` and `OSError`.
    """
    pauses = Pauses(patience)
    while True:
        try:
            return action()
        except (MinioException, HTTPError) as error:
            if not passes(error) or not pauses.wait():
                raise


def passes(error: Exception) -> bool:
    """True when the same request may succeed later."""
    if isinstance(error, S3Error):
        return error.code in _PASSING or error.response.status in BUSY or _is_of_clocks(error)
    if isinstance(error, ServerError):
        return error.status_code in BUSY
    if isinstance(error, InvalidResponseError):  # of a proxy, which speaks no S3
        return any(f"Response code: {code}," in str(error) for code in BUSY)
    if isinstance(error, MaxRetryError):
        return not isinstance(error.reason, SSLError)
    return isinstance(error, HTTPError) and not isinstance(error, SSLError)


def _is_of_clocks(error: S3Error) -> bool:
    """True when a request was refused because it was signed at another time than the server's.

    That has a code of its own, but no code comes with the answer to a HEAD.
    """
    told = parsedate(error.response.headers.get("date"))
    apart = abs(timegm(told) - time.time()) if told else 0
    return error.code == _SKEWED or (error.code == "AccessDenied" and apart > CLOCKS_APART)


def is_refusal(error: S3Error) -> bool:
    """True when a server says no to who asks, or to what is asked, whenever that is.

    What is not there, is there already, or has changed meanwhile may be otherwise the next time.
    """
    status = error.response.status
    return status in range(400, 500) and status not in _CHANGING and not passes(error)


_CHANGING = frozenset({404, 408, 409, 412, 416})
"""HTTP statuses that are about the state of things."""


def _kind(error: S3Error) -> type[StorageError]:
    if error.code in _OF_ONE_OBJECT:
        return ObjectError
    return RefusedError if is_refusal(error) else StorageError


@contextmanager
def explained(attempt: str) -> Iterator[None]:
    """Turn a fault into an error that says what to do.

    Args:
        attempt: the server, and what cannot be done.

    Raises:
        RefusedError: the server refuses, and will do so again.
        StorageError: in place of what `minio` and urllib3 raise.
    """
    try:
        yield
    except S3Error as error:
        cause = f"{(error.message or 'no reason given').rstrip('.')} ({error.code})"
        code = _SKEWED if _is_of_clocks(error) else error.code or ""
        remedy = _REMEDIES.get(code, "The server's own log may tell more.")
        kind = _kind(error)
        raise kind(f"{attempt}: {cause}. {remedy}") from error
    except (MinioException, HTTPError) as error:
        reason = getattr(error, "reason", None) or error
        raise StorageError(
            f"{attempt}: {reason}. Is an S3 server at this address, and can it be reached from "
            "here?"
        ) from error


_OF_ONE_OBJECT = frozenset({"InvalidRange", "NoSuchKey", "PreconditionFailed"})
_REMEDIES = {
    "AccessDenied": "The account's policy must allow it.",
    "InvalidAccessKeyId": "Check the access key.",
    "KeyTooLongError": "S3 takes names of 1,024 bytes, folders included.",
    "SignatureDoesNotMatch": "Check the secret key.",
    "NoSuchKey": "It was there; was it removed meanwhile?",
    "NoSuchBucket": "Is it the right server, or was the bucket removed?",
    "PreconditionFailed": "It has changed meanwhile; try again.",
    _SKEWED: "Its clock and the one here are too far apart: set the wrong one.",
    "XMinioAdminBucketQuotaExceeded": "Raise the bucket's quota.",
    "XMinioStorageFull": "Make room on the server; what is stored stays.",
}
