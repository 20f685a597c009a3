"""The testbed's object stores, through the client that the project uses."""

import io

import pytest
from minio import Minio
from robovast_testbed.s3 import Server


@pytest.fixture
def client(s3_server: Server) -> Minio:
    return Minio(
        s3_server.endpoint,
        access_key=s3_server.access_key,
        secret_key=s3_server.secret_key,
        secure=False,
    )


def _read(client: Minio, bucket: str, key: str) -> bytes:
    answer = client.get_object(bucket, key)
    try:
        return bytes(answer.read())
    finally:
        answer.close()
        answer.release_conn()


def test_an_object_comes_back_as_it_was_put(client: Minio) -> None:
    client.make_bucket("round-trip")
    content = b"run" * 1000
    client.put_object("round-trip", "a/b.txt", io.BytesIO(content), len(content))

    assert _read(client, "round-trip", "a/b.txt") == content
    assert [entry.object_name for entry in client.list_objects("round-trip", recursive=True)] == [
        "a/b.txt"
    ]


def test_objects_survive_a_killed_server(s3_server: Server, client: Minio) -> None:
    client.make_bucket("killed")
    client.put_object("killed", "kept", io.BytesIO(b"kept"), 4)

    s3_server.stop()
    s3_server.start()

    assert _read(client, "killed", "kept") == b"kept"
