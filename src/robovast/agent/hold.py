"""`hold`: keeps a run that somebody looks into alive, and stores nothing of it."""

from __future__ import annotations

from threading import Event

from robovast.agent.container_control import RunContainer
from robovast.agent.mounts import Folders
from robovast.base.signals import call_on_signals
from robovast.kubeapi.pod_contract.exit_codes import AgentExit


def hold(folders: Folders) -> AgentExit:
    """Let the containers of a pod go on after their run, until the pod is told to end."""
    container, stop = RunContainer(folders), Event()
    container.beat_for_ever()
    with call_on_signals(stop.set):
        stop.wait()
    container.end()
    return AgentExit.PASSED
