"""Executes runs as plain processes: the same contract and layout without containers."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

from robovast.base.file_errors import read_content
from robovast.base.serialization import fingerprint
from robovast.execution.compat import check_compat
from robovast.execution.contract import CONFIG, OUT
from robovast.execution.local import process_tree
from robovast.execution.local.process_environment import (
    IMAGE,
    VERSION_FILE,
    cache_folder,
    process_environment,
)
from robovast.execution.local.runtime import RuntimeIdentity, StartSpec
from robovast.execution.local.sandbox import Sandbox, find_sandbox

_INHERITED = ("HOME", "LANG", "LC_ALL", "LOGNAME", "TMPDIR", "TZ", "USER")
_PRIVATE = {"HOME": "/tmp", "TMPDIR": "/tmp"}  # noqa: S108  # a run's own, see sandbox.py
_SHARED_MEMORY = Path("/dev/shm")  # noqa: S108
_MOUNTS = re.compile(r"(?<![\w./-])/(config|out)(?=[/\"'\s)])")


class ProcessRuntime:
    """Starts the run contract's entrypoint as a process."""

    name = "process"

    def __init__(self, message: Callable[[str], None], chosen: Path | None = None) -> None:
        self._chosen = chosen
        self.config_dir: str | None = None
        self.out_dir: str | None = None
        self._message = message
        self._environment: Path | None = None
        self._sandbox: Sandbox | None = None
        self._secondaries: dict[str, list[subprocess.Popen[bytes]]] = {}

    def check(self) -> RuntimeIdentity:
        """Check that the environment exists and has our version of the contract."""
        folder = process_environment(self._message, self._chosen)
        check_compat(str(folder), _read_version(folder))
        self._environment = folder
        self._isolate(folder)
        return RuntimeIdentity(image=f"{IMAGE}{folder.name}", digest="", content=_content(folder))

    def start(self, spec: StartSpec, console: Path) -> subprocess.Popen[bytes]:
        """Start the main entrypoint, and one for each secondary container."""
        if self._sandbox is None:
            _localize_scenario(spec)
        elif spec.secondaries:
            _shared_memory(spec.token).mkdir(mode=0o700, exist_ok=True)
        environment = self._process_environment(spec)
        main = self._spawn(spec, "entrypoint.sh", environment, console)
        self._secondaries[spec.token] = [
            self._spawn(
                spec,
                "secondary_entrypoint.sh",
                {
                    **environment,
                    "CONTAINER_NAME": name,
                    "ROS_LOG_DIR": f"{environment['OUTPUT_DIR']}/logs/{name}",
                },
                console.with_name(f"console_{name}.log"),
            )
            for name in spec.secondaries
        ]
        return main

    def stop(self, spec: StartSpec, process: subprocess.Popen[bytes], grace: float) -> None:
        """End the main process; `clean_up` ends the rest."""
        del spec
        self._end(process, grace)

    def clean_up(self, spec: StartSpec) -> None:
        """End the secondary processes and everything that the scenario left running."""
        for process in self._secondaries.pop(spec.token, []):
            self._end(process, grace=2.0)
        if self._sandbox is None:
            process_tree.kill_marked(f"{spec.token}/")
        elif spec.secondaries:
            shutil.rmtree(_shared_memory(spec.token), ignore_errors=True)

    def clean_up_campaign(self, prefix: str) -> None:
        """End processes of a killed execution."""
        process_tree.kill_marked(f"{prefix}.")
        for folder in _SHARED_MEMORY.glob(f"{prefix}.*"):
            shutil.rmtree(folder, ignore_errors=True)

    def _isolate(self, environment: Path) -> None:
        """Choose how to isolate runs from the machine."""
        interpreter = (environment / "bin" / "python").resolve()
        programs = map(Path, os.get_exec_path())
        found = find_sandbox([environment, interpreter.parent.parent, *programs])
        if isinstance(found, Sandbox):
            self._sandbox, self.config_dir, self.out_dir = found, CONFIG, OUT
            return
        self._message(
            "Runs are not isolated here: they may write wherever you may, and only the text of the "
            f"scenario may name {CONFIG} and {OUT} ({found}). "
            "Install bubblewrap, or allow user namespaces."
        )

    def _spawn(
        self, spec: StartSpec, script: str, environment: Mapping[str, str], console: Path
    ) -> subprocess.Popen[bytes]:
        command = ["bash", f"{environment['ROBOVAST_CONFIG_DIR']}/{script}"]
        if self._sandbox is not None:
            command = self._sandbox.command(console.with_suffix(""), _mounts(spec), command)
        with console.open("wb") as output:
            return subprocess.Popen(
                command,
                cwd=spec.out,
                env=dict(environment),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def _end(self, process: subprocess.Popen[bytes], grace: float) -> None:
        if self._sandbox is None:
            process_tree.stop(process, grace)
        else:
            process_tree.stop_launched(process, grace)

    def _process_environment(self, spec: StartSpec) -> dict[str, str]:
        assert self._environment is not None, "check() comes first"  # noqa: S101
        path = f"{self._environment}/bin:{os.environ.get('PATH', os.defpath)}"
        inherited = {name: os.environ[name] for name in _INHERITED if name in os.environ}
        return {
            **inherited,
            **(_PRIVATE if self._sandbox is not None else {}),
            "PATH": path,
            "ENABLE_X11": "false",
            **spec.environment,
            process_tree.MARKER: f"{spec.token}/",
        }


def _content(environment: Path) -> str:
    """What identifies an environment and the machine around it; empty if its name does not."""
    if environment.parent != cache_folder():
        return ""  # a folder of the user's, whose content may change under its name
    machine = {name: os.environ.get(name) for name in ("PATH", *_INHERITED)}
    return fingerprint([environment.name, socket.gethostname(), machine])


def _mounts(spec: StartSpec) -> dict[str, Path]:
    """Mounts of a job's processes, which share memory like the containers of a pod."""
    shared = {"/dev/shm": _shared_memory(spec.token)} if spec.secondaries else {}  # noqa: S108
    return {CONFIG: spec.config, OUT: spec.out, spec.environment["OUTPUT_DIR"]: spec.job, **shared}


def _shared_memory(token: str) -> Path:
    return _SHARED_MEMORY / token


def _localize_scenario(spec: StartSpec) -> None:
    """Replace `/config` and `/out` in a scenario by the actual paths."""
    scenario = spec.config / spec.environment["SCENARIO_FILE"]
    folders = {"config": str(spec.config), "out": str(spec.out)}
    text = read_content(scenario).decode("utf-8", "surrogateescape")
    changed = _MOUNTS.sub(lambda match: folders[match[1]], text)
    if changed != text:
        scenario.unlink()  # other jobs share the linked file
        scenario.write_text(changed, encoding="utf-8", errors="surrogateescape")


def _read_version(folder: Path) -> str | None:
    try:
        return (folder / VERSION_FILE).read_text(encoding="ascii").strip()
    except OSError:
        return None
