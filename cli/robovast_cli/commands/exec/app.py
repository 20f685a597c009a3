"""`vast exec`: where runs are executed."""

from robovast_cli.lazy import Lazy, new_group

GROUPS = {
    "local": Lazy("robovast_cli.commands.exec.local:app", "Run on this machine."),
    "cluster": Lazy("robovast_cli.commands.exec.cluster.app:app", "Run on a Kubernetes cluster."),
}

app = new_group("Run campaigns.", GROUPS)
