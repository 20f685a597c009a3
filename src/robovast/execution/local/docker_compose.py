"""The compose file of a job: main container, and secondary ones in the same network."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robovast.execution.contract import CONFIG, ENTRYPOINT, OUT, SECONDARY_ENTRYPOINT
from robovast.execution.local.runtime import Limits

MAIN = "robovast"
"""Name of the main service."""


def compose_model(
    *,
    name: str | None,
    image: str,
    environment: Mapping[str, str],
    volumes: list[str],
    user: str,
    limits: Limits,
    secondaries: Mapping[str, Limits],
    network_mode: str,
    labels: Mapping[str, str],
    confined: bool = False,
) -> dict[str, Any]:
    """A compose file as plain data.

    Args:
        name: name of the main container; None lets compose choose one.
        image: image of all containers.
        environment: variables of the main container; others receive it with CONTAINER_NAME.
        volumes: `source:target[:ro]`, for all containers.
        user: `uid:gid`.
        limits: limits of the main container.
        secondaries: limits of the secondary containers, by name.
        network_mode: `bridge` or `host`, for the main container.
        labels: labels of all containers, used to find them again.
        confined: no program in the containers can gain permissions, such as with `sudo`.
    """
    common = {
        "image": image,
        "volumes": volumes,
        "user": user,
        "working_dir": OUT,
        "labels": dict(labels),
        "init": True,
        **({"security_opt": ["no-new-privileges"]} if confined else {}),
    }
    main = {
        **common,
        **({"container_name": name} if name else {}),
        "entrypoint": ["/bin/bash", f"{CONFIG}/{ENTRYPOINT}"],
        "environment": _literal(environment),
        "network_mode": network_mode,
        "ipc": "shareable",
        **_limits(limits),
    }
    services = {MAIN: main}
    for name, own in secondaries.items():
        extra = {"CONTAINER_NAME": name, "ROS_LOG_DIR": f"{environment['OUTPUT_DIR']}/logs/{name}"}
        services[name] = {
            **common,
            "entrypoint": ["/bin/bash", f"{CONFIG}/{SECONDARY_ENTRYPOINT}"],
            "environment": _literal({**environment, **extra}),
            "network_mode": f"service:{MAIN}",
            "ipc": f"service:{MAIN}",
            "depends_on": [MAIN],
            **_limits(own),
        }
    return {"services": services}


def run_options(service: Mapping[str, Any]) -> list[str]:
    """Arguments of `docker run` (options, image, command) for a main service without others.

    Compose does the same, but doubles the time to start the container.
    """
    keys = {"--cpus": "cpus", "--memory": "mem_limit", "--shm-size": "shm_size"}
    limits = {option: service.get(key) for option, key in keys.items()}
    program, *arguments = service["entrypoint"]
    single = {
        "--name": service["container_name"],
        "--user": service["user"],
        "--workdir": service["working_dir"],
        "--network": service["network_mode"],
        "--ipc": service["ipc"],
        "--entrypoint": program,
        **{option: value for option, value in limits.items() if value is not None},
    }
    options = [f"{option}={value}" for option, value in single.items()]
    options += [f"--volume={volume}" for volume in service["volumes"]]
    options += [f"--security-opt={value}" for value in service.get("security_opt", ())]
    options += [f"--label={name}={value}" for name, value in service["labels"].items()]
    for name, value in service["environment"].items():
        options.append(f"--env={name}={value.replace('$$', '$')}")
    return ["--init", *options, service["image"], *arguments]


def _literal(environment: Mapping[str, str]) -> dict[str, str]:
    """Escape values: compose would expand `$NAME` in them."""
    return {name: value.replace("$", "$$") for name, value in environment.items()}


def _limits(limits: Limits) -> dict[str, Any]:
    result: dict[str, Any] = {}
    if limits.cpus is not None:
        result["cpus"] = limits.cpus
    if limits.memory is not None:
        result["mem_limit"] = limits.memory
    if limits.shm is not None:
        result["shm_size"] = limits.shm
    if limits.gpus:
        device = {"driver": "nvidia", "count": limits.gpus, "capabilities": ["gpu"]}
        result["deploy"] = {"resources": {"reservations": {"devices": [device]}}}
    return result
