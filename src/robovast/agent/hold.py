"""`hold`: prepares a run that somebody looks into, keeps it alive, and stores nothing of it."""

from __future__ import annotations

import time
from threading import Event

from robovast.agent.container_control import RunContainer
from robovast.agent.mounts import Folders
from robovast.agent.preparation import prepare_apart
from robovast.base.signals import call_on_signals
from robovast.kubeapi.pod_contract.pack_request import PackRequest

LOOK = 0.5
"""How often to look whether the pod is told to end [s]."""


def hold(folders: Folders, request: PackRequest) -> int:
    """Let the containers of a pod go on after their run, until the pod is told to end.

    Args:
        folders: of the pod.
        request: the run.

    Raises:
        KilledError: the process that prepares it was killed.
    """
    container, stop = RunContainer(folders), Event()
    container.begin()
    try:
        with call_on_signals(stop.set):
            code = prepare_apart(folders, request, stop)
            while code == 0 and not stop.is_set():  # as in `separate_process`
                time.sleep(LOOK)
            return code
    finally:
        container.end()
