"""How the operator logs in, and kopf with it."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from kubernetes.config import incluster_config

from robovast.base.errors import CannotRunError
from robovast_operator.__main__ import login
from robovast_operator.kube.api import server


def test_a_pod_goes_to_the_address_that_it_is_given_and_reads_its_token_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    token, authority = tmp_path / "token", tmp_path / "ca.crt"
    token.write_text("first")
    authority.write_text("an authority")
    monkeypatch.setattr(incluster_config, "SERVICE_TOKEN_FILENAME", str(token))
    monkeypatch.setattr(incluster_config, "SERVICE_CERT_FILENAME", str(authority))
    monkeypatch.setenv("KUBERNETES_SERVICE_HOST", "fd00::1")
    monkeypatch.setenv("KUBERNETES_SERVICE_PORT", "6443")
    made = server()
    assert made.host == "https://[fd00::1]:6443"
    assert asyncio.run(made.get_api_key_with_prefix("BearerToken")) == "bearer first"
    token.write_text("second")
    shell = login()
    assert (shell.server, shell.token, shell.ca_path) == (made.host, "second", str(authority))


def test_who_has_neither_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("KUBERNETES_SERVICE_HOST", raising=False)
    monkeypatch.setattr("kubernetes.config.kube_config.KUBE_CONFIG_DEFAULT_LOCATION", "/missing")
    with pytest.raises(CannotRunError, match="neither a service account nor a kubeconfig"):
        server()
