"""Runs in containers: Docker or Podman, by compose."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import ClassVar

from robovast.errors import CannotRunError
from robovast.execution.compat import VERSION_PATH, check_compat
from robovast.execution.local import process_tree
from robovast.execution.local.compose import compose_model
from robovast.execution.local.events import LocalOptions
from robovast.execution.local.runtime import Identity, JobSpec
from robovast.plain import dump_yaml

X11_SOCKETS = Path("/tmp/.X11-unix")  # noqa: S108  # where X servers listen
LABEL = "robovast.job"


def engine_answers(engine: str) -> bool:
    """True when the program is installed and its daemon, if it has one, answers."""
    if shutil.which(engine) is None:
        return False
    return _call([engine, "info", "--format", "{{.Driver}}{{.Store.GraphDriverName}}"]).ok or (
        _call([engine, "info"]).ok
    )


class ContainerRuntime:
    """Starts each job as one compose project."""

    config_dir: ClassVar[str | None] = "/config"
    out_dir: ClassVar[str | None] = "/out"

    def __init__(
        self, engine: str, image: str, options: LocalOptions, message: Callable[[str], None]
    ) -> None:
        self.name = engine
        self._image = image
        self._options = options
        self._message = message

    def check(self) -> Identity:
        """Make sure that the engine answers and that the image is here and compatible."""
        self._check_engine()
        _ = self._compose
        self._fetch_image()
        command = [self.name, "run", "--rm", "--network", "none", "--entrypoint", "cat"]
        result = _call([*command, self._image, VERSION_PATH])
        if not result.ok and "No such file" not in result.errors:
            raise CannotRunError(f"{self._image} cannot be started: {result.last_error}")
        check_compat(self._image, result.output.strip() if result.ok else None)
        return Identity(self._image, self._digest())

    def start(self, spec: JobSpec, console: Path) -> subprocess.Popen[bytes]:
        """Start the job's containers; the process ends with the main container's exit code."""
        self._compose_file(spec).write_text(dump_yaml(self._model(spec)), encoding="utf-8")
        script = f'"${{@:2}}" && exit "$({self.name} wait "$1")"'
        with console.open("wb") as output:
            return subprocess.Popen(
                ["bash", "-c", script, "bash", spec.token, *self._project(spec), "up", "--detach"],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def stop(self, spec: JobSpec, process: subprocess.Popen[bytes], grace: float) -> None:
        """Stop the job's containers."""
        self._run_compose(spec, "stop", "--timeout", str(int(grace)))
        if not process_tree.wait(process, grace):
            process_tree.stop(process, 0)

    def clean_up(self, spec: JobSpec) -> None:
        """Remove the job's containers."""
        self._run_compose(spec, "down", "--timeout", "2", "--volumes", "--remove-orphans")

    def clean_up_campaign(self, prefix: str) -> None:
        """Remove containers of an execution that was killed."""
        listing = _call([self.name, "ps", "-aq", "--filter", f"label={LABEL}={prefix}"])
        if listing.ok and listing.output.split():
            _call([self.name, "rm", "-f", *listing.output.split()])

    @cached_property
    def _compose(self) -> list[str]:
        standalone = f"{self.name}-compose"
        if _call([self.name, "compose", "version"]).ok:
            return [self.name, "compose"]
        if shutil.which(standalone):
            return [standalone]
        raise CannotRunError(
            f"{self.name} is here, but neither `{self.name} compose` nor `{standalone}`: install "
            f"the compose plugin, or use `--runtime process`."
        )

    def _check_engine(self) -> None:
        if shutil.which(self.name) is None:
            raise CannotRunError(
                f"there is no `{self.name}` here: install it, or use `--runtime process`."
            )
        result = _call([self.name, "info"])
        if not result.ok:
            raise CannotRunError(
                f"{self.name} does not answer: {result.last_error}. Is its daemon running, and may "
                "you use it? Or use `--runtime process`."
            )

    def _fetch_image(self) -> None:
        if _call([self.name, "image", "inspect", self._image]).ok:
            return
        self._message(f"Pulling {self._image} …")
        result = _call([self.name, "pull", "--quiet", self._image])
        if not result.ok:
            raise CannotRunError(
                f"the image {self._image} is not on this machine and cannot be pulled: "
                f"{result.last_error}. Check its name, log in to its registry, or build it with "
                "container/build.sh."
            )

    def _digest(self) -> str:
        pattern = "{{if .RepoDigests}}{{index .RepoDigests 0}}{{else}}{{.Id}}{{end}}"
        return _call([self.name, "image", "inspect", "-f", pattern, self._image]).output.strip()

    def _model(self, spec: JobSpec) -> dict[str, object]:
        volumes = [
            f"{spec.config}:/config:ro",
            f"{spec.out}:/out",
            f"{spec.job}:/out/_jobs/{spec.job.name}",
        ]
        environment = dict(spec.environment)
        display = os.environ.get("DISPLAY")
        if self._options.gui and display and X11_SOCKETS.is_dir():
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
            labels={LABEL: spec.token.partition(".")[0]},
        )

    def _run_compose(self, spec: JobSpec, *command: str) -> None:
        _call([*self._project(spec), *command])

    def _project(self, spec: JobSpec) -> list[str]:
        """The command line that speaks of a job's compose project."""
        name = spec.token.replace(".", "-")
        return [*self._compose, "-p", name, "-f", str(self._compose_file(spec))]

    def _compose_file(self, spec: JobSpec) -> Path:
        return spec.work / "compose.yaml"


class _Result:
    def __init__(self, process: subprocess.CompletedProcess[str]) -> None:
        self.ok = process.returncode == 0
        self.output = process.stdout
        self.errors = process.stderr

    @property
    def last_error(self) -> str:
        lines = [line for line in self.errors.strip().splitlines() if line.strip()]
        return lines[-1].strip() if lines else "no message"


def _call(command: list[str]) -> _Result:
    return _Result(subprocess.run(command, capture_output=True, text=True, check=False))
