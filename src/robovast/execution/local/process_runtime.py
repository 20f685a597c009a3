"""Runs as plain processes: the same contract and layout, no container."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import ClassVar

from robovast.execution.compat import check_compat
from robovast.execution.local import process_tree
from robovast.execution.local.process_environment import VERSION_FILE, process_environment
from robovast.execution.local.runtime import Identity, JobSpec

_INHERITED = ("HOME", "LANG", "LC_ALL", "LOGNAME", "TMPDIR", "TZ", "USER")
_MOUNTS = re.compile(r"(?<![\w./-])/(config|out)(?=[/\"'\s)])")


class ProcessRuntime:
    """Starts the run contract's entrypoint as a process of this machine."""

    name = "process"
    config_dir: ClassVar[str | None] = None
    out_dir: ClassVar[str | None] = None

    def __init__(self, message: Callable[[str], None]) -> None:
        self._message = message
        self._environment: Path | None = None
        self._secondaries: dict[str, list[subprocess.Popen[bytes]]] = {}

    def check(self) -> Identity:
        """Make sure that the environment exists and speaks our version of the contract."""
        folder = process_environment(self._message)
        check_compat(str(folder), _read_version(folder))
        self._environment = folder
        return Identity(image=f"process:{folder.name}", digest="")

    def start(self, spec: JobSpec, console: Path) -> subprocess.Popen[bytes]:
        """Start the main entrypoint and one more for each secondary container."""
        _localize_scenario(spec)
        environment = self._process_environment(spec)
        main = self._spawn(spec, "entrypoint.sh", environment, console)
        self._secondaries[spec.token] = [
            self._spawn(
                spec,
                "secondary_entrypoint.sh",
                {**environment, "CONTAINER_NAME": name, "ROS_LOG_DIR": f"{spec.job}/logs/{name}"},
                console.with_name(f"console_{name}.log"),
            )
            for name in spec.secondaries
        ]
        return main

    def stop(self, spec: JobSpec, process: subprocess.Popen[bytes], grace: float) -> None:
        """End the main process; `clean_up` ends the rest."""
        del spec
        process_tree.stop(process, grace)

    def clean_up(self, spec: JobSpec) -> None:
        """End the secondary processes and whatever the scenario left behind."""
        for process in self._secondaries.pop(spec.token, []):
            process_tree.stop(process, grace=2.0)
        process_tree.kill_marked(f"{spec.token}/")

    def clean_up_campaign(self, prefix: str) -> None:
        """End processes of an execution that was killed."""
        process_tree.kill_marked(f"{prefix}.")

    def _spawn(
        self, spec: JobSpec, script: str, environment: Mapping[str, str], console: Path
    ) -> subprocess.Popen[bytes]:
        with console.open("wb") as output:
            return subprocess.Popen(
                ["bash", str(spec.config / script)],
                cwd=spec.out,
                env=dict(environment),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def _process_environment(self, spec: JobSpec) -> dict[str, str]:
        assert self._environment is not None, "check() comes first"  # noqa: S101
        path = f"{self._environment}/bin:{os.environ.get('PATH', os.defpath)}"
        inherited = {name: os.environ[name] for name in _INHERITED if name in os.environ}
        return {
            **inherited,
            "PATH": path,
            "ENABLE_X11": "false",
            **spec.environment,
            process_tree.MARKER: f"{spec.token}/",
        }


def _localize_scenario(spec: JobSpec) -> None:
    """Let a scenario that was written for `/config` and `/out` find them where they are here."""
    scenario = spec.config / spec.environment["SCENARIO_FILE"]
    folders = {"config": str(spec.config), "out": str(spec.out)}
    text = scenario.read_text(encoding="utf-8", errors="surrogateescape")
    changed = _MOUNTS.sub(lambda match: folders[match[1]], text)
    if changed != text:
        scenario.unlink()  # the file is a link that other jobs share
        scenario.write_text(changed, encoding="utf-8", errors="surrogateescape")


def _read_version(folder: Path) -> str | None:
    try:
        return (folder / VERSION_FILE).read_text(encoding="ascii").strip()
    except OSError:
        return None
