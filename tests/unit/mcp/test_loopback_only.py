"""The server is reached from this machine only, and by who knows a secret."""

from __future__ import annotations

import pytest

from robovast.base.errors import InputError
from robovast.mcp.loopback import listen
from robovast_cli.commands.mcp import TOKEN, choose_token


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "", "192.0.2.1", "example.org"])  # noqa: S104
def test_another_interface_is_refused(host: str) -> None:
    with pytest.raises(InputError, match="this machine only"):
        listen(host, 0)


def test_a_port_that_is_taken_is_named() -> None:
    with listen("127.0.0.1", 0) as listener:
        port = listener.getsockname()[1]
        with pytest.raises(InputError, match=f"Port {port} of 127.0.0.1"):
            listen("127.0.0.1", port)


def test_a_token_is_new_each_time_unless_it_is_given() -> None:
    first, told = choose_token({})
    assert first in told
    assert len(first) >= 32
    assert first != choose_token({})[0]
    given, told = choose_token({TOKEN: "mine"})
    assert given == "mine"
    assert "mine" not in told
    with pytest.raises(InputError, match="is empty"):
        choose_token({TOKEN: " "})
