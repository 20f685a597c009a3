"""`vast exec`: run campaigns on this machine or on a cluster."""

from robovast_cli.lazy import Lazy, new_group

GROUPS = {
    "local": Lazy("robovast_cli.commands.exec.local:app", "Run campaigns on this machine."),
    "cluster": Lazy(
        "robovast_cli.commands.exec.cluster.app:app", "Run campaigns on a Kubernetes cluster."
    ),
}

app = new_group("Run campaigns.", GROUPS)
