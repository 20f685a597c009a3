"""What a plugin raises is told with the place in its own code."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import InputError
from robovast.model.document import load_document
from robovast.model.expansion import expand

PLUGIN = """\
import subprocess
from pathlib import Path
from robovast.common.variation import Variation

class Width(Variation):
    def variation(self, in_configs):
        return broken(self, in_configs)

def broken(variation, in_configs):
    return {}
"""


@pytest.mark.parametrize(
    ("expression", "told"),
    [
        ("variation.parameters['least']", "KeyError: 'least'"),
        ("subprocess.run(['/nowhere/tool'])", "FileNotFoundError: .*/nowhere/tool'"),
        ("variation.update_config(in_configs[0], 7)", "[A-Z][A-Za-z]+Error: .*"),
        ("1 / 0", "ZeroDivisionError: division by zero"),
    ],
)
def test_the_place_is_in_the_plugins_own_code(tmp_path: Path, expression: str, told: str) -> None:
    (tmp_path / "width.py").write_text(PLUGIN.format(expression))
    (tmp_path / "a.osc").write_text("scenario a:\n    width: float = 1.0\n")
    file = tmp_path / "a.vast"
    file.write_text(
        "version: 1\nexecution: {scenario_file: a.osc}\n"
        "configuration: [{name: a, variations: [width.py:Width: {x: 1}]}]\n"
    )
    with pytest.raises(InputError, match=rf"{told} \(.*/width\.py:10\)$"):
        expand(load_document(file), tmp_path)
