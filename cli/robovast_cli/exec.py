"""`vast exec`: where runs are executed."""

from robovast_cli.lazy import Lazy, new_group

GROUPS = {"local": Lazy("robovast_cli.local:app", "Run on this machine.")}

app = new_group("Run campaigns.", GROUPS)
