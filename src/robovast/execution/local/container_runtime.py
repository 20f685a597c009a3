"""Executes runs in containers with Docker or Podman, using compose."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

from robovast.base.containers import call, check_engine, fetch_image, image_digest
from robovast.base.errors import CannotRunError
from robovast.base.serialization import dump_yaml
from robovast.campaign.layout import JOBS
from robovast.execution.compat import VERSION_PATH, check_compat
from robovast.execution.contract import CONFIG, OUT
from robovast.execution.local import process_tree
from robovast.execution.local.docker_compose import MAIN, compose_model, run_options
from robovast.execution.local.events import LocalOptions
from robovast.execution.local.runtime import RuntimeIdentity, StartSpec

X11_SOCKETS = Path("/tmp/.X11-unix")  # noqa: S108  # where X servers listen
LABEL = "robovast.job"
_NOT_STARTED = (125, 126, 127)
"""Exit codes of `docker run` if a container could not be started."""


class ContainerRuntime:
    """Starts each job as a container, or as a compose project if it has secondary containers."""

    def __init__(
        self, engine: str, image: str, options: LocalOptions, message: Callable[[str], None]
    ) -> None:
        self.config_dir: str | None = CONFIG
        self.out_dir: str | None = OUT
        self.name = engine
        self._image = image
        self._options = options
        self._message = message
        self._started: dict[str, subprocess.Popen[bytes]] = {}

    def check(self) -> RuntimeIdentity:
        """Check the engine, pull the image if necessary, and check its compatibility."""
        check_engine(self.name, "use `--runtime process`")
        _ = self._compose
        fetch_image(self.name, self._image, self._message, "build it with container/build.sh")
        command = [self.name, "run", "--rm", "--network", "none", "--entrypoint", "cat"]
        result = call([*command, self._image, VERSION_PATH])
        if not result.ok and "No such file" not in result.errors:
            raise CannotRunError(
                f"{self._image} cannot be started: {result.last_error}",
                hint="check the image, or use `--runtime process`",
            )
        check_compat(self._image, result.output.strip() if result.ok else None)
        digest = image_digest(self.name, self._image)
        return RuntimeIdentity(self._image, digest, content=digest)

    def start(self, spec: StartSpec, console: Path) -> subprocess.Popen[bytes]:
        """Start the job's containers; the process ends with the main container's exit code."""
        model = self._model(spec)
        if _is_alone(spec):
            command = [self.name, "run", "--rm", *run_options(model["services"][MAIN])]
        else:
            self._compose_file(spec).write_text(dump_yaml(model), encoding="utf-8")
            script = f'"${{@:2}}" && exit "$({self.name} wait "$1")"'
            up = [*self._project(spec), "up", "--detach"]
            command = ["bash", "-c", script, "bash", spec.token, *up]
        with console.open("wb") as output:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        self._started[spec.token] = process
        return process

    def stop(self, spec: StartSpec, process: subprocess.Popen[bytes], grace: float) -> None:
        """Stop the job's containers."""
        if _is_alone(spec):
            call([self.name, "stop", "--time", str(int(grace)), spec.token])
        else:
            self._run_compose(spec, "stop", "--timeout", str(int(grace)))
        if not process_tree.wait(process, grace):
            process_tree.stop(process, 0)

    def clean_up(self, spec: StartSpec) -> None:
        """Remove the job's containers; the engine removes single containers itself."""
        process = self._started.pop(spec.token, None)
        if not _is_alone(spec):
            self._run_compose(spec, "down", "--timeout", "2", "--volumes", "--remove-orphans")
        elif process is None or _may_be_left(process.poll()):
            call([self.name, "rm", "--force", "--volumes", spec.token])

    def clean_up_campaign(self, prefix: str) -> None:
        """Remove containers of a killed execution."""
        listing = call([self.name, "ps", "-aq", "--filter", f"label={LABEL}={prefix}"])
        if listing.ok and listing.output.split():
            call([self.name, "rm", "-f", *listing.output.split()])

    @cached_property
    def _compose(self) -> list[str]:
        standalone = f"{self.name}-compose"
        if call([self.name, "compose", "version"]).ok:
            return [self.name, "compose"]
        if shutil.which(standalone):
            return [standalone]
        raise CannotRunError(
            f"{self.name} is installed, but neither `{self.name} compose` nor `{standalone}`",
            hint="install the compose plugin, or use `--runtime process`",
        )

    def _model(self, spec: StartSpec) -> dict[str, Any]:
        volumes = [
            f"{spec.config}:/config:ro",
            f"{spec.out}:/out",
            f"{spec.job}:/out/{JOBS}/{spec.job.name}",
        ]
        environment = dict(spec.environment)
        display = os.environ.get("DISPLAY")
        if spec.display and display and X11_SOCKETS.is_dir():
            volumes.append(f"{X11_SOCKETS}:{X11_SOCKETS}")
            environment["DISPLAY"] = display
        return compose_model(
            name=spec.token,
            image=self._image,
            environment=environment,
            volumes=volumes,
            user=spec.user,
            limits=spec.limits,
            secondaries=spec.secondaries,
            network_mode="host" if self._options.network_host else "bridge",
            confined=spec.confined,
            labels={LABEL: spec.token.partition(".")[0]},
        )

    def _run_compose(self, spec: StartSpec, *command: str) -> None:
        call([*self._project(spec), *command])

    def _project(self, spec: StartSpec) -> list[str]:
        """The compose command line for a job's project."""
        name = spec.token.replace(".", "-")
        return [*self._compose, "-p", name, "-f", str(self._compose_file(spec))]

    def _compose_file(self, spec: StartSpec) -> Path:
        return spec.work / "compose.yaml"


def _is_alone(spec: StartSpec) -> bool:
    """Whether a job has a single container, which needs no compose."""
    return not spec.secondaries and not spec.limits.gpus


def _may_be_left(code: int | None) -> bool:
    """Whether a container may be left because the engine's program did not see it end."""
    return code is None or code < 0 or code in _NOT_STARTED
