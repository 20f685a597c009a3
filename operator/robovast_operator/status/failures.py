"""Why a reconcile failed, as reason and message of the condition. Pure functions."""

from __future__ import annotations

from robovast.base.errors import RobovastError
from robovast_operator.kube.api import ApiError
from robovast_operator.kube.sentences import after_colon, clause, sentence
from robovast_operator.pods.admission import NamespaceLimits, explain
from robovast_operator.pods.observations import Trouble
from robovast_operator.pods.own import OWN

_QUOTA = ("exceeded quota", "status unknown for quota")
_TOO_LARGE = ("request is too large", "Too long: ", "limit is ")
"""Texts of the API server about an object that is too large."""


def trouble_of_error(error: Exception) -> Trouble:
    """Return why a reconcile failed."""
    if isinstance(error, RobovastError):
        return Trouble("Invalid", sentence(str(error), "The Campaign is invalid: "))
    if isinstance(error, TimeoutError) or (isinstance(error, ApiError) and error.code == 0):
        cause = after_colon(str(error))
        message = f"The API server is not responding{cause}. The operator tries again."
        return Trouble("ApiServerUnreachable", message)
    if isinstance(error, ApiError):
        return _refusal(error, str(error))
    message = (
        f"The operator has an internal error: {clause(f'{type(error).__name__}: {error}')}. Read "
        "the log of the operator."
    )
    return Trouble("OperatorError", message)


def _refusal(error: ApiError, message: str) -> Trouble:
    rejection = f"The API server rejects an object of the campaign: {clause(message)}."
    if any(text in message for text in _QUOTA):
        why = explain(message, {}, NamespaceLimits(), OWN)
        remedy = "Ask your cluster administrator to raise the quota."
        return Trouble(
            "QuotaExceeded",
            f"{why} Message of the API server: {clause(message)}."
            if why
            else f"{rejection} {remedy}",
        )
    if error.code == 413 or any(text in message for text in _TOO_LARGE):
        return Trouble(
            "ObjectTooLarge",
            f"{rejection} Move large files to spec.source.bundle or spec.source.git, or split the "
            ".vast file.",
        )
    remedy = "Check the permissions and policies of the namespace with your cluster administrator."
    return Trouble("RequestDenied", f"{rejection} {remedy}")
