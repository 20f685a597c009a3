"""The compose file of a job."""

from robovast.execution.local.docker_compose import compose_model, run_options
from robovast.execution.local.runtime import Limits


def model(**changes: object) -> dict:
    arguments: dict = {
        "name": "robovast-1.job-0",
        "image": "image:1",
        "environment": {"OUTPUT_DIR": "/out/_jobs/job-0", "PRICE": "5$ or ${HOME}"},
        "volumes": ["/a:/config:ro"],
        "user": "1000:1000",
        "limits": Limits(),
        "secondaries": {},
        "network_mode": "bridge",
        "labels": {"robovast.job": "x"},
    }
    return compose_model(**{**arguments, **changes})["services"]


def test_values_with_a_dollar_reach_the_container_as_they_are() -> None:
    assert model()["robovast"]["environment"]["PRICE"] == "5$$ or $${HOME}"


def test_secondary_containers_share_network_and_image_and_know_their_name() -> None:
    services = model(secondaries={"nav": Limits(cpus=3, memory=2**30, gpus=1)})
    nav = services["nav"]
    assert nav["network_mode"] == "service:robovast"
    assert nav["image"] == "image:1"
    assert nav["environment"]["CONTAINER_NAME"] == "nav"
    assert nav["environment"]["ROS_LOG_DIR"] == "/out/_jobs/job-0/logs/nav"
    assert (nav["cpus"], nav["mem_limit"]) == (3, 2**30)
    device = nav["deploy"]["resources"]["reservations"]["devices"][0]
    assert device == {"driver": "nvidia", "count": 1, "capabilities": ["gpu"]}


def test_without_limits_nothing_is_limited() -> None:
    assert not {"cpus", "mem_limit", "deploy"} & set(model()["robovast"])


def test_shared_memory_is_the_main_containers_and_others_share_it() -> None:
    services = model(limits=Limits(shm=2**30), secondaries={"nav": Limits()})
    assert services["robovast"]["shm_size"] == 2**30
    assert services["nav"]["ipc"] == "service:robovast"
    assert "shm_size" not in services["nav"]
    assert f"--shm-size={2**30}" in run_options(services["robovast"])


def test_the_name_is_left_to_compose_when_none_is_given() -> None:
    assert "container_name" not in model(name=None)["robovast"]


def test_a_container_alone_is_started_as_compose_would() -> None:
    service = model(limits=Limits(cpus=1.5, memory=2**30))["robovast"]
    *options, image, script = run_options(service)
    assert (image, script) == ("image:1", "/config/entrypoint.sh")
    assert set(options) == {
        "--init",
        "--name=robovast-1.job-0",
        "--user=1000:1000",
        "--workdir=/out",
        "--network=bridge",
        "--entrypoint=/bin/bash",
        "--ipc=shareable",
        "--cpus=1.5",
        f"--memory={2**30}",
        "--volume=/a:/config:ro",
        "--label=robovast.job=x",
        "--env=OUTPUT_DIR=/out/_jobs/job-0",
        "--env=PRICE=5$ or ${HOME}",
    }
