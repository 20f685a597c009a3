"""Errors of S3 servers: which are temporary, and how to describe them."""

from __future__ import annotations

import logging
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

REPORTED_AFTER = 20.0
"""Duration of errors from which they are logged, once [s]."""

_log = logging.getLogger(__name__)


class ObjectError(StorageError):
    """One object is damaged, missing or wrong; others are not affected."""


CLOCKS_APART = 600
"""Difference of clocks from which servers may refuse requests; most allow 15 minutes [s]."""
_SKEWED = "RequestTimeTooSkewed"
_DENIED = "AccessDenied"
_PASSING = frozenset(
    {
        "BadDigest",  # damaged during transfer
        "ConditionalRequestConflict",
        "IncompleteBody",
        "InternalError",
        "NoSuchUpload",  # a restart forgot the parts of a large file
        "OperationAborted",
        _SKEWED,  # the request was delayed, or a clock is wrong
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
    """Call `action`, and repeat it after temporary errors.

    Args:
        action: an idempotent function.
        patience: how long to repeat it [s].

    Raises:
        MinioException: the last error; also urllib3's `HTTPError` and `OSError`.
    """
    pauses = Pauses(patience)
    since, reported, denied = time.monotonic(), False, False
    while True:
        try:
            return action()
        except (MinioException, HTTPError) as error:
            if not denied and getattr(error, "code", None) == _DENIED:
                denied = True  # the clock may have been corrected since the request was signed
                continue
            if not passes(error) or not pauses.wait():
                raise
            if not reported and time.monotonic() - since > REPORTED_AFTER:
                reported = True
                _log.warning("S3 is tried again for up to %.0f s: %s", patience, _text(error))


def passes(error: Exception) -> bool:
    """Whether the same request may succeed later."""
    if isinstance(error, S3Error):
        return error.code in _PASSING or error.response.status in BUSY or _is_of_clocks(error)
    if isinstance(error, ServerError):
        return error.status_code in BUSY
    if isinstance(error, InvalidResponseError):  # from a proxy
        return any(f"Response code: {code}," in str(error) for code in BUSY)
    if isinstance(error, MaxRetryError):
        return not isinstance(error.reason, SSLError)
    return isinstance(error, HTTPError) and not isinstance(error, SSLError)


def _is_of_clocks(error: S3Error) -> bool:
    """Whether a request was refused because client and server have different times.

    That error has its own code, but responses to HEAD contain no code.
    """
    told = parsedate(error.response.headers.get("date"))
    apart = abs(timegm(told) - time.time()) if told else 0
    return error.code == _SKEWED or (error.code == _DENIED and apart > CLOCKS_APART)


def is_refusal(error: S3Error) -> bool:
    """Whether a server refuses a request permanently.

    Errors about missing, existing or changed objects are not permanent.
    """
    status = error.response.status
    return status in range(400, 500) and status not in _CHANGING and not passes(error)


_CHANGING = frozenset({404, 408, 409, 412, 416})
"""HTTP statuses about the state of objects."""


def _kind(error: S3Error) -> type[StorageError]:
    if error.code in _OF_ONE_OBJECT:
        return ObjectError
    return RefusedError if is_refusal(error) else StorageError


@contextmanager
def storage_errors(attempt: str) -> Iterator[None]:
    """Convert an error to one with a remedy.

    Args:
        attempt: the server and the failed operation.

    Raises:
        RefusedError: the server refuses permanently.
        StorageError: in place of other errors of `minio` and urllib3.
    """
    try:
        yield
    except (MinioException, HTTPError) as error:
        kind = _kind(error) if isinstance(error, S3Error) else StorageError
        raise kind(f"{attempt}: {_text(error)}") from error


def _text(error: Exception) -> str:
    """The cause of an error, and its remedy."""
    if not isinstance(error, S3Error):
        reason = getattr(error, "reason", None) or error
        return f"{reason}. Is an S3 server at this address, and can it be reached from here?"
    cause = f"{(error.message or 'no reason given').rstrip('.')} ({error.code})"
    code = _SKEWED if _is_of_clocks(error) else error.code or ""
    remedy = _REMEDIES.get(code, "Read the log of the server.")
    return f"{cause}. {remedy}"


_OF_ONE_OBJECT = frozenset({"InvalidRange", "NoSuchKey", "PreconditionFailed"})
_OTHER_KEYS = (
    "The server has no account with this access key: the keys are outdated or belong to another "
    "server. Pods use the keys in the Secret of the Campaign's namespace (default: "
    "`robovast-storage`)."
)
_REMEDIES = {
    _DENIED: "The account's policy must allow it.",
    "InvalidAccessKeyId": _OTHER_KEYS,
    "KeyTooLongError": "S3 takes names of 1,024 bytes, folders included.",
    "SignatureDoesNotMatch": "Check the secret key.",
    "NoSuchKey": "It existed; check whether it was removed.",
    "NoSuchBucket": "Is it the right server, or was the bucket removed?",
    "PreconditionFailed": "It has changed; try again.",
    _SKEWED: "Its clock and the one here are too far apart: set the wrong one.",
    "XAdminUserNotFound": _OTHER_KEYS,
    "XMinioAdminBucketQuotaExceeded": "Raise the bucket's quota.",
    "XMinioStorageFull": "Free space on the server. Stored objects are kept.",
}
