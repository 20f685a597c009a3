"""The run images: what the entrypoint and the compatibility check find in them."""

import pytest
from robovast_testbed.docker import Docker
from robovast_testbed.errors import StartFailed

COMPAT_FILE = "/etc/robovast_compat_version"


@pytest.mark.parametrize(
    "tool",
    ["bash", "find", "ps", "python3", "scenario_execution", "start-stop-daemon", "stdbuf", "tee"],
)
def test_slim_image_has_the_tools_of_the_entrypoint(
    docker_daemon: Docker, slim_image: str, tool: str
) -> None:
    found = docker_daemon.run(
        "run", "--rm", "--network=none", slim_image, "bash", "-c", f"command -v {tool}"
    )

    assert found.strip().endswith(f"/{tool}")


def test_slim_image_executes_a_scenario(docker_daemon: Docker, slim_image: str) -> None:
    scenario = "import osc.helpers\\nscenario empty:\\n    do serial:\\n        log('hello')\\n"
    steps = (
        f'printf "{scenario}" > /tmp/empty.osc',
        "scenario_execution -o /tmp /tmp/empty.osc >&2",
        "cat /tmp/test.xml",
    )

    report = docker_daemon.run(
        "run", "--rm", "--network=none", slim_image, "bash", "-c", " && ".join(steps)
    )

    assert 'errors="0"' in report
    assert 'failures="0"' in report


def test_slim_image_has_a_numeric_user_and_no_x11(docker_daemon: Docker, slim_image: str) -> None:
    template = "{{.Config.User}} {{range .Config.Env}}{{println .}}{{end}}"
    settings = docker_daemon.run("image", "inspect", "--format", template, slim_image)

    assert settings.split()[0] == "1000"
    assert "ENABLE_X11=false" in settings.split()


def test_compat_images_differ_in_what_they_state(
    docker_daemon: Docker, slim_image: str, wrong_compat_image: str, no_compat_image: str
) -> None:
    def stated(image: str) -> str:
        return docker_daemon.run("run", "--rm", "--network=none", image, "cat", COMPAT_FILE).strip()

    assert stated(slim_image) == "2"
    assert stated(wrong_compat_image) == "1"
    with pytest.raises(StartFailed, match="No such file"):
        stated(no_compat_image)
