"""Prepares the runs of a pod in a process of its own.

It needs the document, its models and YAML, which take more memory than all that follows; a pod has
its agent for as long as its runs take.
"""

from __future__ import annotations

import signal
from threading import Event

from robovast.agent import quick_start
from robovast.agent.container_control import RunContainer
from robovast.agent.mounts import Folders
from robovast.agent.reporting import run_and_report
from robovast.agent.separate_process import apart
from robovast.kubeapi.pod_contract.exit_codes import AgentExit, KilledError
from robovast.kubeapi.pod_contract.pack_request import PackRequest


def prepare_apart(folders: Folders, request: PackRequest, stop: Event) -> int:
    """Prepare runs while the heartbeat goes on, and let their containers begin.

    Returns:
        0 when they are prepared; else the exit code of an error, which is reported.

    Raises:
        KilledError: the process was killed.
    """
    container = RunContainer(folders)
    if container.is_terminated():  # it did not wait for so long
        return AgentExit.RUNS_LEFT

    def prepare() -> int:
        module = quick_start.load("robovast.agent.prepare")
        code = run_and_report(
            lambda: module.prepare(folders, request), folders.message, as_json=True
        )
        return AgentExit.REFUSED_AT_START if code == AgentExit.REFUSED else code

    code = apart(prepare, container.beat_for_ever, stop)
    if stop.is_set():
        return AgentExit.RUNS_LEFT
    if code < 0:
        raise KilledError(
            f"the process that prepares the runs was ended by {signal.Signals(-code).name}",
            hint="if it needs more memory than the container `agent` has, divide the document",
        )
    return code
