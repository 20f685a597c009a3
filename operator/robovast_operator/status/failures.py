"""Why a reconcile failed, as reason and message of the condition. Pure functions."""

from __future__ import annotations

from robovast.base.errors import RobovastError
from robovast_operator.kube.api import ApiError
from robovast_operator.pods.admission import NamespaceLimits, explain
from robovast_operator.pods.findings import Trouble
from robovast_operator.pods.own import OWN

_QUOTA = ("exceeded quota", "status unknown for quota")
_TOO_LARGE = ("request is too large", "Too long: ", "limit is ")
"""What the API server says of an object that is larger than it keeps."""


def trouble_of_error(error: Exception) -> Trouble:
    """Why a reconcile failed."""
    if isinstance(error, RobovastError):
        return Trouble("Invalid", str(error))
    if isinstance(error, ApiError) and error.code == 0:
        return Trouble("Unreachable", str(error))
    if isinstance(error, ApiError):
        return _refusal(error, str(error))
    if isinstance(error, TimeoutError):
        return Trouble("Unreachable", f"the API server does not answer: {error}")
    told = f"{type(error).__name__}: {error}"
    return Trouble("OperatorError", f"a fault of the operator, whose log says more: {told}")


def _refusal(error: ApiError, message: str) -> Trouble:
    told = f"the API server refuses what the campaign needs: {message}."
    if any(text in message for text in _QUOTA):
        why = explain(message, {}, NamespaceLimits(), OWN)
        remedy = "Ask your cluster administrator to raise the quota."
        return Trouble(
            "QuotaExceeded", f"{why} The API server: {message}" if why else f"{told} {remedy}"
        )
    if error.code == 413 or any(text in message for text in _TOO_LARGE):
        return Trouble(
            "TooLarge",
            f"{told} Bring large files by spec.source.bundle or git, and divide a large document.",
        )
    return Trouble("RequestDenied", told)
