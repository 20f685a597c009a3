"""`vast exec cluster shell`: a shell in the container of a running run."""

from __future__ import annotations

import shutil
import subprocess
import sys

from robovast.base.errors import CannotRunError
from robovast.execution.contract import OUT
from robovast.kubeapi.pod_contract.pack_request import RUN
from robovast_cli.commands.exec.cluster.logs import RunNames, Secondary, open_runs, parse_names
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.kube.pods import check_container, has_started, waiting_reason
from robovast_cli.lazy import examples

SHELL = ("bash", "-c", f"cd {OUT} && exec bash")


@examples(
    ("vast exec cluster shell hall-1/0", "Open a shell in the main container"),
    ("vast exec cluster shell hall-1/0 --secondary simulator", "Open one in another container"),
)
def shell(
    names: RunNames = None,
    secondary: Secondary = None,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Open a shell in the container of a running run (requires kubectl)."""
    campaign, run = parse_names(names)
    if shutil.which("kubectl") is None:
        raise CannotRunError(
            "`kubectl`, which opens the shell, is not installed.", hint="install `kubectl`"
        )
    container = secondary or RUN
    with open_runs(context, namespace, campaign) as (kube, runs):
        executor = runs.executor(run)
        if executor is None:
            logs = " ".join(["vast exec cluster logs", *(names or ())]) + kube.cluster_options
            raise CannotRunError(
                f"{run} is not running", hint=f"run `{logs}` to see its log, or why it is pending"
            )
        check_container(executor.pod, container)
        if not has_started(executor.pod, container):
            raise CannotRunError(
                f"{run} is not running yet: {waiting_reason(executor.pod)}.",
                hint="wait, then run the command again",
            )
        where = ["--context", kube.context] if kube.context else []
        where += ["--namespace", kube.namespace]
    terminal = "--stdin --tty" if sys.stdin.isatty() and sys.stdout.isatty() else "--stdin"
    command = ["kubectl", *where, "exec", *terminal.split(), executor.name, "--container"]
    return subprocess.run([*command, container, "--", *SHELL], check=False).returncode
