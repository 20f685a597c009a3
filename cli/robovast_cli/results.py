"""`vast results`: from result folders to answers."""

from collections.abc import Mapping

from robovast_cli.lazy import Lazy, new_group

COMMANDS: Mapping[str, Lazy] = {}

app = new_group("Bring results home, work them up, ask them, publish them.", COMMANDS)
