"""Converts refusals of an API server to errors for users."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robovast.base.errors import CannotRunError, InputError, RobovastError


class NotFoundError(CannotRunError):
    """There is no such object."""


class NotInstalledError(CannotRunError):
    """The cluster does not know RoboVAST's resources."""


class ConflictError(CannotRunError):
    """There is such an object already, or it has changed meanwhile."""


class UnreachableError(CannotRunError):
    """The API server does not answer, or not yet."""


def refusal(code: int, status: Mapping[str, Any], where: str) -> RobovastError:
    """The error for an answer of the API server.

    Args:
        code: HTTP status.
        status: the `Status` object of the answer; empty when it had none.
        where: the server, as messages name it.
    """
    message = str(status.get("message") or f"HTTP status {code}").rstrip(".")
    if code in (400, 413, 422):
        return InputError(_invalid(status, message, where))
    if code == 401:
        return CannotRunError(
            f"{where} does not accept your credentials",
            hint="log in again, or select another context with `--context`",
        )
    if code == 403:
        return CannotRunError(f"{where} denied the request: {message}", hint=_remedy(message))
    if code == 404 and not status.get("details", {}).get("name"):
        return NotInstalledError(
            f"RoboVAST is not installed in this cluster ({where}): the CRDs are missing",
            hint="install it with `vast exec cluster setup CLUSTER_CONFIG`; `--list` lists the "
            "cluster configurations",
        )
    if code == 429 or code >= 500:
        return unreachable(message, where)
    kind = {404: NotFoundError, 409: ConflictError}.get(code, CannotRunError)
    return kind(f"{where}: {message}.")


def unreachable(cause: str, where: str) -> RobovastError:
    """The error when the API server does not answer."""
    return UnreachableError(
        f"cannot connect to {where}: {cause}",
        hint="check that the cluster is running and that the context is correct. `kubectl "
        "config get-contexts` lists all; `--context` selects one",
    )


def _remedy(message: str) -> str:
    """Return the remedy for a denied request: permissions or quota may be missing."""
    if "exceeded quota" in message:
        return (
            "delete unused objects (`vast exec cluster run-cleanup` deletes finished campaigns), "
            "or ask your cluster administrator to raise the quota"
        )
    return (
        "ask your cluster administrator for a RoleBinding in this namespace, or select another "
        "one with `--namespace`"
    )


def _invalid(status: Mapping[str, Any], message: str, where: str) -> str:
    """One line for each field that is refused."""
    details = status.get("details") or {}
    causes = details.get("causes") or []
    if not causes:
        return f"{where} rejected the request: {message}."
    lines = dict.fromkeys(_cause(cause) for cause in causes)
    name = f"the {details.get('kind', 'object')} `{details.get('name', '')}`"
    return "\n".join([f"{where} rejected {name}:", *(f"    {line}" for line in lines)])


def _cause(cause: Mapping[str, Any]) -> str:
    field = str(cause.get("field") or "").removeprefix("spec.vast.")
    message = str(cause.get("message") or "")
    return f"{field}: {message}" if field and field != "<nil>" else message
