"""`vast exec cluster shell`: a shell in the container of a running run."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence

from robovast.base.errors import CannotRunError
from robovast.execution.contract import OUT
from robovast.kubeapi.pod_contract.pack_request import RUN
from robovast_cli.commands.exec.cluster.logs import campaign_and_run, opened_runs
from robovast_cli.kube.pods import check_container, has_begun, waiting_reason

SHELL = ("bash", "-c", f"cd {OUT} && exec bash")


def shell(
    context: str | None, namespace: str | None, words: Sequence[str], secondary: str | None
) -> int:
    """Open a shell in the container of a run; returns its exit code.

    Args:
        context: of the kubeconfig; the current one when None.
        namespace: the context's when None.
        words: the campaign, which may be left out, and the run.
        secondary: name of a secondary container; the main one when None.

    Raises:
        InputError: there is no such campaign, run or container.
        CannotRunError: the run is not executed now, or kubectl is missing.
    """
    campaign, run = campaign_and_run(words)
    if shutil.which("kubectl") is None:
        raise CannotRunError(
            "`kubectl`, which opens the shell, is not installed.", hint="install `kubectl`"
        )
    container = secondary or RUN
    with opened_runs(context, namespace, campaign) as (kube, runs):
        executor = runs.executor(run)
        if executor is None:
            logs = " ".join(["vast exec cluster logs", *words]) + kube.given
            raise CannotRunError(
                f"{run} is not running", hint=f"run `{logs}` to see its log, or why it is pending"
            )
        check_container(executor.pod, container)
        if not has_begun(executor.pod, container):
            raise CannotRunError(
                f"{run} is not running yet: {waiting_reason(executor.pod)}.",
                hint="wait, then run the command again",
            )
        where = ["--context", kube.context] if kube.context else []
        where += ["--namespace", kube.namespace]
    terminal = "--stdin --tty" if sys.stdin.isatty() and sys.stdout.isatty() else "--stdin"
    command = ["kubectl", *where, "exec", *terminal.split(), executor.name, "--container"]
    return subprocess.run([*command, container, "--", *SHELL], check=False).returncode
