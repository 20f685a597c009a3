"""The Job that uploads a campaign: what it may, what it knows, what it does not show."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from robovast.agent.share import UploadProgress
from robovast.base.errors import InputError
from robovast.execution.cluster_execution.share_providers.base import BaseShareProvider
from robovast.kubeapi.resources import MANAGED_LABEL, ROLE_LABEL, Scheduling
from robovast.kubeapi.share_job import Upload, agent_image, share_job, share_secret, share_variables

OWNER = {"metadata": {"name": "hall", "uid": "uid-1"}}
UPLOAD = Upload(
    campaign="hall-2026-03-04-132444",
    bucket="hall-2026-03-04-132444",
    endpoint="http://s3.ns.svc:9000",
    image="registry/agent:1",
    region="eu-1",
    secret="keys",
    owner=OWNER,
    scheduling=Scheduling(
        node_selector={"disk": "large"}, image_pull_secrets=[{"name": "robovast-pull"}]
    ),
)


class Own(BaseShareProvider):
    SHARE_TYPE = "own"
    env: dict[str, Any] = {"OWN_URL": "https://x", "OWN_TOKEN": "hidden", "OWN_PORT": None}  # noqa: RUF012

    def required_env_vars(self) -> dict[str, str]:
        return {"ANOTHER": "not for pods"}

    def build_pod_env(self) -> dict[str, str]:
        return self.env

    def upload_archive(self, *_: object) -> None: ...


def test_the_job_is_suspended_restricted_and_knows_its_results() -> None:
    job = share_job(UPLOAD, "described")
    assert job["metadata"]["name"] == "hall-2026-03-04-132444-share"
    assert job["metadata"]["ownerReferences"][0]["uid"] == "uid-1"
    assert MANAGED_LABEL not in job["metadata"]["labels"]
    assert job["spec"]["template"]["metadata"]["labels"][ROLE_LABEL] == "share"
    assert job["spec"]["suspend"]
    pod = job["spec"]["template"]["spec"]
    assert pod["nodeSelector"] == {"kubernetes.io/os": "linux", "disk": "large"}
    assert pod["imagePullSecrets"] == [{"name": "robovast-pull"}]
    assert not pod["automountServiceAccountToken"]
    (container,) = pod["containers"]
    assert container["command"][3:] == [
        "share",
        "--campaign=hall-2026-03-04-132444",
        "--bucket=hall-2026-03-04-132444",
        "--endpoint=http://s3.ns.svc:9000",
        "--region=eu-1",
        "--uid=uid-1",
    ]
    volumes = {v["name"]: v.get("secret", {}).get("secretName") for v in pod["volumes"]}
    assert volumes == {"work": None, "credentials": "keys", "share": "described"}


def test_what_describes_the_share_stands_in_its_secret_alone() -> None:
    variables = share_variables("own", Own(), Path())
    assert variables == {
        "OWN_URL": "https://x",
        "OWN_TOKEN": "hidden",
        "ROBOVAST_SHARE_TYPE": "own",
    }
    job = {**share_job(UPLOAD, "described")}
    job["metadata"] = {**job["metadata"], "uid": "uid-2"}
    assert "hidden" not in json.dumps(job)
    secret = share_secret(job, "described", variables)
    assert secret["stringData"] == variables
    assert secret["metadata"]["ownerReferences"][0]["uid"] == "uid-2"


def test_a_provider_that_is_a_file_goes_along(tmp_path: Path) -> None:
    (tmp_path / "tools").mkdir()
    (tmp_path / "tools" / "own.py").write_text("# its code\n")
    variables = share_variables("tools/own.py:Own", Own(), tmp_path)
    assert variables["ROBOVAST_SHARE_TYPE"] == "provider.py:Own"
    assert variables["provider.py"] == "# its code\n"


def test_a_variable_that_none_can_be_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Own, "env", {"OWN-URL": "x"})
    with pytest.raises(InputError, match="`own` wants a variable `OWN-URL`"):
        share_variables("own", Own(), Path())


def test_a_campaign_that_was_removed_owns_nothing() -> None:
    job = share_job(Upload("a" * 80, "b" * 63, "http://s3", "image"), "described")
    assert "ownerReferences" not in job["metadata"]
    assert len(job["metadata"]["name"]) <= 63


def test_the_agents_image_is_that_of_a_campaigns_jobs() -> None:
    own = {"image": "agent:1", "command": ["python", "-m", "robovast.agent", "agent"]}
    other = {"image": "robot:7", "command": ["bash", "/config/start.sh"]}

    def job(*containers: object) -> dict[str, Any]:
        return {"spec": {"template": {"spec": {"containers": list(containers)}}}}

    assert agent_image([job(other), job({"image": "x"}, other, own)]) == "agent:1"
    assert agent_image([job(other)]) is None
    assert agent_image([]) is None


def test_progress_is_told_now_and_then_and_at_the_end(capsys: pytest.CaptureFixture[str]) -> None:
    times = iter([0, 1, 6, 7, 12, 13, 14])
    progress = UploadProgress("packed", clock=lambda: next(times))
    for done in (1, 2, 3, 3, 4, 4):
        progress(done * 1024, 4096)
    assert capsys.readouterr().out.splitlines() == [
        "packed 50% (2.0 KiB of 4.0 KiB)",
        "packed 75% (3.0 KiB of 4.0 KiB)",
        "packed 100% (4.0 KiB of 4.0 KiB)",
    ]
