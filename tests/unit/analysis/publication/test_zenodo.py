"""The plugin `zenodo` against a server that speaks Zenodo's documented API."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.servers.fake_zenodo import TOKEN, Zenodo, zenodo_server

from robovast.analysis.publication import zenodo_api
from robovast.analysis.publication.context import PublicationCampaign, PublicationContext
from robovast.analysis.publication.zenodo import ZenodoUpload
from robovast.analysis.publication.zenodo_api import ZenodoApi
from robovast.base.errors import InputError, RobovastError, StorageError

DESCRIBED = {"title": "T", "description": "D", "creators": ["Lovelace, Ada"], "robot_id": 7}


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Zenodo]:
    with zenodo_server() as zenodo:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setenv("ROBOVAST_ZENODO_URL", zenodo.address)
        monkeypatch.setenv("ROBOVAST_ZENODO_TOKEN", TOKEN)
        yield zenodo


@pytest.fixture
def context(tmp_path: Path) -> PublicationContext:
    (tmp_path / "a b.zip").write_bytes(b"first" * 100_000)
    (tmp_path / "b.zip").write_bytes(b"")
    campaign = PublicationCampaign(tmp_path / "camp-2026-01-01-000000", DESCRIBED)
    return PublicationContext((campaign,), (tmp_path / "a b.zip", tmp_path / "b.zip"))


def upload(context: PublicationContext, **parameters: Any) -> str:
    results = context.files[0].parent if context.files else Path()
    good, message = ZenodoUpload()(str(results), "", context=context, **parameters)
    assert good
    return message


def drafts(server: Zenodo) -> list[dict[str, Any]]:
    return list(server.deposits.values())


def test_archives_go_into_a_draft_that_is_not_published(
    server: Zenodo, context: PublicationContext
) -> None:
    seen: list[tuple[str, int, int]] = []
    message = upload(replace(context, progress=lambda *step: seen.append(step)))
    (draft,) = drafts(server)
    assert draft["submitted"] is False
    assert server.contents[draft["id"]] == {p.name: p.read_bytes() for p in context.files}
    assert draft["metadata"] | DESCRIBED == draft["metadata"] | {
        "robot_id": 7,
        "creators": ["Lovelace, Ada"],
    }
    assert draft["metadata"]["creators"] == [{"name": "Lovelace, Ada"}]
    assert draft["metadata"]["upload_type"] == "dataset"
    assert "robot_id" not in draft["metadata"]
    assert (
        message == f"2 archives in the draft {server.address}/deposit/1000; not published:"
        " review and publish it there"
    )
    assert seen[-1] == ("a b.zip", 500_000, 500_000)


def test_publishing_needs_to_be_told(server: Zenodo, context: PublicationContext) -> None:
    upload(context)
    upload(context)
    assert not any("publish" in path for path in server.requests("POST"))
    message = upload(context, publish=True)
    assert len(drafts(server)) == 1
    assert drafts(server)[0]["submitted"] is True
    assert "2 archives published" in message
    assert "10.5072/zenodo.1000" in message


def test_a_published_record_is_not_touched_again(
    server: Zenodo, context: PublicationContext
) -> None:
    upload(context, publish=True)
    server.log.clear()
    assert "published" in upload(context, publish=True)
    assert {line.partition(" ")[0] for line in server.log} == {"GET"}
    context.files[1].write_text("changed")
    with pytest.raises(StorageError, match=r"is published and cannot be changed; b\.zip would"):
        upload(context, publish=True)


def test_an_interrupted_upload_goes_on_in_the_same_draft(
    server: Zenodo, context: PublicationContext
) -> None:
    def interrupt(name: str, done: int, total: int) -> None:
        if name == "a b.zip":
            raise KeyboardInterrupt

    context.files[1].write_bytes(b"second")
    with pytest.raises(KeyboardInterrupt):
        upload(replace(context, files=context.files[::-1], progress=interrupt))
    assert list(server.contents[1000]) == ["b.zip"]
    server.log.clear()
    upload(context)
    assert len(drafts(server)) == 1
    assert [path for path in server.requests("PUT") if "files" in path] == [
        "/api/files/bucket-1000/a%20b.zip"
    ]


def test_a_cut_connection_costs_one_more_attempt(
    server: Zenodo, context: PublicationContext
) -> None:
    server.fail("PUT", 0, times=2)
    server.fail("GET", 502)
    upload(context)
    assert server.contents[1000].keys() == {"a b.zip", "b.zip"}
    assert len(drafts(server)) == 1


def test_an_archive_that_changed_is_sent_again(server: Zenodo, context: PublicationContext) -> None:
    upload(context)
    context.files[1].write_text("changed")
    upload(context)
    assert server.contents[1000]["b.zip"] == b"changed"


def test_a_draft_that_was_removed_is_replaced(server: Zenodo, context: PublicationContext) -> None:
    upload(context)
    server.deposits.clear()
    server.deposits[1] = {}
    upload(context)
    assert 1001 in server.deposits


def test_a_draft_can_be_named(server: Zenodo, context: PublicationContext) -> None:
    number = server.new()["id"]
    upload(context, deposition=number)
    assert len(drafts(server)) == 1
    with pytest.raises(InputError, match="the account has no deposit 77"):
        upload(context, deposition=77)


def test_a_lost_answer_to_publishing_is_looked_up(
    server: Zenodo, context: PublicationContext
) -> None:
    upload(context)
    server.lose_answer_of = "POST"
    assert "published" in upload(context, publish=True)
    assert server.requests("POST").count("/api/deposit/depositions/1000/actions/publish") == 1


def test_a_lost_answer_makes_no_second_draft(server: Zenodo, context: PublicationContext) -> None:
    server.lose_answer_of = "POST"
    with pytest.raises(StorageError, match="cannot create a draft"):
        upload(context)
    assert len(drafts(server)) == 1


def test_what_arrives_damaged_is_not_published(
    server: Zenodo, context: PublicationContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload(context)
    real = ZenodoApi.upload

    def damaging(self: ZenodoApi, *arguments: Any) -> None:
        real(self, *arguments)
        server.contents[1000]["b.zip"] = b"damaged"

    monkeypatch.setattr(ZenodoApi, "upload", damaging)
    context.files[0].write_text("changed")
    with pytest.raises(StorageError, match="was not published"):
        upload(context, publish=True)
    assert drafts(server)[0]["submitted"] is False


ERRORS = {
    401: "cannot create a draft (401, as it was told). Check the access token",
    403: "(403, as it was told). Check the access token",
    413: "the request is larger than the server accepts",
    500: "(500, as it was told). Try again later: the server has an internal error",
}


@pytest.mark.parametrize("status", ERRORS)
def test_an_error_says_what_to_do(server: Zenodo, context: PublicationContext, status: int) -> None:
    server.fail("POST", status)
    with pytest.raises(StorageError) as caught:
        upload(context)
    assert ERRORS[status] in str(caught.value)


def test_a_busy_server_is_given_the_time_it_asks_for(
    server: Zenodo, context: PublicationContext
) -> None:
    server.fail("POST", 429, Retry_After="1")
    upload(context)
    server.fail("PUT", 429, Retry_After="3600")
    with pytest.raises(StorageError, match=r"\(429, .*Wait for 3600 s, as the server asks\."):
        upload(context)


def test_the_token_is_in_no_message_and_no_file(
    server: Zenodo,
    context: PublicationContext,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    tmp_path: Path,
) -> None:
    caplog.set_level("DEBUG")
    upload(context)
    assert TOKEN not in (tmp_path / ".zenodo.json").read_text() + caplog.text
    monkeypatch.setenv("ROBOVAST_ZENODO_TOKEN", "wrong-token-91")
    with pytest.raises(StorageError) as caught:
        upload(context)
    assert "not authorized" in str(caught.value)
    assert "wrong-token-91" not in str(caught.value) + caplog.text


def test_the_token_may_stand_in_a_dotenv_file(
    server: Zenodo,
    context: PublicationContext,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.delenv("ROBOVAST_ZENODO_TOKEN")
    with pytest.raises(InputError, match="set the variable ROBOVAST_ZENODO_TOKEN"):
        upload(context)
    with pytest.raises(InputError, match="set the variable ROBOVAST_ZENODO_SANDBOX_TOKEN"):
        upload(context, sandbox=True)
    (tmp_path / ".env").write_text(f"ROBOVAST_ZENODO_SANDBOX_TOKEN='{TOKEN}'\n")
    (tmp_path / "below").mkdir()
    monkeypatch.chdir(tmp_path / "below")
    upload(context, sandbox=True)


def test_the_token_goes_to_no_other_server(server: Zenodo, context: PublicationContext) -> None:
    server.bucket_host = "http://127.0.0.1:9"
    with pytest.raises(StorageError, match="uploads would go to another server"):
        upload(context)
    with pytest.raises(InputError, match="does not begin with https"):
        ZenodoApi("http://zenodo.example.org", TOKEN)


def test_the_sandbox_is_another_server(
    context: PublicationContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def api(address: str, token: str) -> ZenodoApi:
        asked.append(address)
        raise InputError("stop")

    monkeypatch.setattr(zenodo_api, "ZenodoApi", api)
    monkeypatch.setenv("ROBOVAST_ZENODO_SANDBOX_TOKEN", "x")
    monkeypatch.setenv("ROBOVAST_ZENODO_TOKEN", "y")
    for sandbox in (True, False):
        with pytest.raises(InputError, match="stop"):
            upload(context, sandbox=sandbox)
    assert asked == ["https://sandbox.zenodo.org", "https://zenodo.org"]


def test_what_is_missing_is_said_before_anything_is_sent(
    server: Zenodo, context: PublicationContext
) -> None:
    wrong: list[tuple[PublicationContext, str]] = [
        (replace(context, files=()), "nothing to upload"),
        (
            replace(context, files=(Path("a/x.zip"), Path("b/x.zip"))),
            "two archives are named x.zip",
        ),
        (
            replace(context, campaigns=(PublicationCampaign(Path("a"), {}),)),
            "Zenodo needs `creators`",
        ),
    ]
    for case, message in wrong:
        with pytest.raises(RobovastError, match=message):
            upload(case)
    assert server.log == []


def test_a_server_that_is_not_zenodo_is_told(server: Zenodo, context: PublicationContext) -> None:
    server.deposits[1000] = {}
    (context.files[0].parent / ".zenodo.json").write_text("half")
    with pytest.raises(StorageError, match=r"\.zenodo\.json: cannot be read"):
        upload(context)
    (context.files[0].parent / ".zenodo.json").write_text(json.dumps({"other": 1}))
    upload(context, metadata={"version": "2"})
