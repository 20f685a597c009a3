"""The address of the S3 server, as the operator passes it to our own containers."""

from __future__ import annotations

import os
from collections.abc import Mapping

from robovast.kubeapi.pod_contract.exit_codes import PlanError
from robovast.storage.endpoint import Endpoint

ENDPOINT = "ROBOVAST_S3_ENDPOINT"
REGION = "ROBOVAST_S3_REGION"


def address_variables(endpoint: str, region: str | None) -> list[dict[str, str]]:
    """Return the environment variables of a container that uses the S3 server."""
    return [{"name": ENDPOINT, "value": endpoint}, {"name": REGION, "value": region or ""}]


def joined_address(endpoint: str, region: str | None) -> str:
    """Return endpoint and region as one text, to compare addresses."""
    return f"{endpoint} {region or ''}".strip()


def passed_address(environment: Mapping[str, str] = os.environ) -> Endpoint:
    """Return the S3 server that the operator passed to this container.

    Raises:
        PlanError: the variable is not set.
    """
    if not environment.get(ENDPOINT):
        raise PlanError(
            f"The environment variable {ENDPOINT} is not set, which the operator sets",
            hint="check that operator and agent have the same version",
        )
    return Endpoint.parse(environment[ENDPOINT], environment.get(REGION))
