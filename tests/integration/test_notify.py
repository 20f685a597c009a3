"""The command that sends a notice, against a real HTTP server."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import pytest
from support.patience import PATIENCE
from support.servers.notices import Receiver, receiving

from robovast.agent import notify as command
from robovast.agent.mounts import Folders
from robovast.base.errors import StorageError
from robovast.kubeapi.notice import NOTICE_VARIABLE, Named, Notice, Order
from robovast.kubeapi.resources import Notification
from robovast.kubeapi.status import Runs

SECRET = "tk_neverseenanywhere"
TOPIC = "alice-9f4e1c"

NOTICE = Notice(
    id="0123456789abcdef0123456789abcdef",
    event="Finished",
    time="2026-11-21T12:00:00Z",
    campaign=Named(namespace="lab", name="drive", uid="u", results="drive-2026", bucket="drive"),
    verdict="Failed",
    runs=Runs(total=3, passed=2, failed=1, stored=3),
    failing=["hall-1/2"],
    seconds=3900,
    reason="TooManyUnsuccessfulRuns",
    message="2 of 3 runs passed; spec.acceptance requires all.",
)


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    with receiving() as made:
        yield made


@dataclass(frozen=True)
class Ended:
    """A pod that has ended."""

    code: int
    said: str
    message: str


@dataclass(frozen=True)
class Pod:
    """A notification's pod, as a process."""

    folder: Path

    def send(self, event: Notice = NOTICE, index: int = 0, **receiver: Any) -> Ended:
        words = [sys.executable, "-m", "robovast.agent", "notify"]
        words += ["--receivers", str(self.folder), "--message", str(self.folder / "message")]
        (self.folder / "message").touch()
        env = {**os.environ, NOTICE_VARIABLE: order(event, **receiver)}
        done = subprocess.run(
            words,
            env=env | {"JOB_COMPLETION_INDEX": str(index)},
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        message = (self.folder / "message").read_text()
        return Ended(done.returncode, done.stdout + done.stderr, message)

    def secret(self, file: str, text: str) -> dict[str, str]:
        """A key of a Secret, mounted for the first receiver."""
        (self.folder / "0").mkdir(exist_ok=True)
        (self.folder / "0" / file).write_text(f"{text}\n")
        return {"name": "phone", "key": file}


@pytest.fixture
def pod(tmp_path: Path) -> Pod:
    return Pod(tmp_path)


def order(event: Notice, **receiver: Any) -> str:
    receivers = [Notification.model_validate({"kind": "ntfy", **receiver})]
    return Order(notice=event, receivers=receivers).model_dump_json()


def test_ntfy_gets_title_priority_and_tags_as_headers_and_the_text_as_body(
    receiver: Receiver, pod: Pod
) -> None:
    url, token = pod.secret("url", f"{receiver.url}/{TOPIC}"), pod.secret("token", SECRET)
    ended = pod.send(urlFrom=url, tokenFrom=token, link="https://lab.example/drive")
    assert ended.code == 0, ended.said
    (got,) = receiver.received
    assert got.path == f"/{TOPIC}"
    wanted = {
        "Title": "drive has failed",
        "Priority": "4",
        "Tags": "x",
        "Click": "https://lab.example/drive",
        "X-Sequence-ID": NOTICE.id,
        "Authorization": f"Bearer {SECRET}",
    }
    assert {name: got.headers.get(name) for name in wanted} == wanted
    assert got.body.splitlines() == [
        "3 runs: 2 passed, 1 failed, 0 errored after 1 h 5 min",
        "33 % did not pass (95 % interval 6.1 – 79 %)",
        "2 of 3 runs passed; spec.acceptance requires all.",
        "Not passed: hall-1/2",
        "vast results download -n lab -i drive",
    ]
    assert SECRET not in ended.said + ended.message
    assert TOPIC not in ended.said + ended.message


def test_a_webhook_gets_all_of_it_as_json_and_a_text_for_chats(
    receiver: Receiver, pod: Pod
) -> None:
    ended = pod.send(kind="webhook", url=f"{receiver.url}/hooks/1", link="https://lab.example")
    assert ended.code == 0, ended.said
    (got,) = receiver.received
    assert got.headers["Content-Type"] == "application/json"
    assert got.headers["Idempotency-Key"] == NOTICE.id
    data = got.json
    assert data["text"].startswith("drive has failed\n3 runs: 2 passed")
    assert (data["version"], data["event"], data["verdict"]) == (1, "Finished", "Failed")
    assert data["campaign"]["name"] == "drive"
    counts = {name: data["runs"][name] for name in ("total", "passed", "failed", "errored")}
    assert counts == {"total": 3, "passed": 2, "failed": 1, "errored": 0}
    assert (data["seconds"], data["failing"]) == (3900, ["hall-1/2"])
    assert data["link"] == "https://lab.example"


def test_a_server_that_is_busy_is_asked_again(receiver: Receiver, pod: Pod) -> None:
    receiver.answers = [503, 429, 500]
    assert pod.send(url=f"{receiver.url}/{TOPIC}").code == 0
    assert len(receiver.received) == 4
    assert len({got.headers["X-Sequence-ID"] for got in receiver.received}) == 1


@pytest.mark.parametrize(
    ("status", "said"), [(403, "Use an account that is allowed"), (302, "it has moved")]
)
def test_what_a_server_refuses_is_not_sent_again_and_no_message_tells_a_secret(
    receiver: Receiver, pod: Pod, status: int, said: str
) -> None:
    receiver.answers = [status]
    receiver.headers = {"Location": f"{receiver.url}/{TOPIC}?auth={SECRET}"}
    receiver.text = json.dumps({"error": f"{SECRET} may not write to {TOPIC}"})
    login = receiver.url.replace("://", f"://alice:{SECRET}@")
    ended = pod.send(urlFrom=pod.secret("url", f"{login}/{TOPIC}"))
    assert ended.code == 65
    assert len(receiver.received) == 1
    assert "Authorization" in receiver.received[0].headers
    assert said in ended.message
    assert receiver.url in ended.message
    assert ended.message in ended.said
    assert SECRET not in ended.said
    assert TOPIC not in ended.said


@pytest.mark.parametrize("path", ["hook?token={}&v=1", "api/webhooks/42/{}", "a?b={}#c"])
@pytest.mark.parametrize("secret", ["S3CR3T-abc", "x%2Fy+z9", "ß9-secret"])
@pytest.mark.parametrize("before", [0, 294])
def test_no_message_has_a_part_of_the_address(
    receiver: Receiver, pod: Pod, path: str, secret: str, before: int
) -> None:
    """However the server quotes it, also at the place where its answer is cut."""
    receiver.answers = [403]
    receiver.text = json.dumps({"error": "." * before + f"unknown webhook {unquote(secret)}"})
    url = f"{receiver.url}/{path.format(quote(secret, safe='%+'))}"
    ended = pod.send(urlFrom=pod.secret("url", url))
    assert ended.code == 65
    for text in (secret, unquote(secret)):
        assert text not in ended.said
        assert text[:6] not in ended.said
    assert before or "webhook" in ended.said


def test_a_server_that_is_gone_is_a_case_for_another_pod(pod: Pod) -> None:
    with socket.socket() as silent:  # nobody else gets its port, and it does not listen
        silent.bind(("127.0.0.1", 0))
        port = silent.getsockname()[1]
        ended = pod.send(url=f"http://127.0.0.1:{port}/{TOPIC}")
    assert ended.code == 74
    assert f"http://127.0.0.1:{port} does not answer" in ended.message
    assert TOPIC not in ended.said


def test_a_server_that_says_nothing_keeps_nobody(
    receiver: Receiver, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    receiver.silence = 0.5
    monkeypatch.setattr(command, "TIMEOUT", 0.1)
    monkeypatch.setattr(command, "REPEATABLE", 0.2)
    monkeypatch.setenv(NOTICE_VARIABLE, order(NOTICE, url=f"{receiver.url}/{TOPIC}"))
    with pytest.raises(StorageError, match="does not answer as it should"):
        command.notify(Folders(receivers=tmp_path), 0)


@pytest.mark.parametrize("text", ["", "two\nlines", "ftp://a/b", "https://[a/b"])
def test_a_secret_that_is_missing_or_holds_no_url_is_told_by_its_name(pod: Pod, text: str) -> None:
    named = pod.secret("url", text) if text else {"name": "phone", "key": "url"}
    ended = pod.send(urlFrom=named)
    assert ended.code == 65
    assert "`phone`" in ended.message or "does not start with http" in ended.message
    assert not text or text not in ended.said


def test_another_version_of_the_operator_is_told(pod: Pod) -> None:
    ended = pod.send(event=NOTICE.model_copy(update={"version": 2}), url="http://a/b")
    assert ended.code == 64
    assert "the same version" in ended.message
