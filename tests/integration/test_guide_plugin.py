"""The postprocessing plugin of the developer guide, whose script may be missing in a campaign."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.campaigns.finished import finished_campaign
from support.fuzzing.readers import run_command

PLUGIN = """
from typing import Tuple, Optional, List
def my_postprocessing_command(
    results_dir: str,
    config_dir: str,
    custom_param: Optional[str] = None,
    provenance_file: Optional[str] = None,
) -> Tuple[bool, str]:
    import subprocess
    import os
    script = os.path.join(config_dir, "tools/script.sh")
    cmd = [{shell}script, results_dir]
    if custom_param:
        cmd.extend(["--param", custom_param])
    result = subprocess.run(cmd, capture_output=True, text=True)
    if result.returncode != 0:
        return False, f"Failed: {{result.stderr}}"
    return True, "Success"
"""
CALL = "    - tools/plugins.py:my_postprocessing_command:\n        custom_param: value\n"


@pytest.mark.parametrize("shell", ["", '"sh", '])
def test_a_missing_script_is_reported_with_its_remedy(tmp_path: Path, shell: str) -> None:
    campaign = finished_campaign(tmp_path / "results", 2, CALL, PLUGIN.format(shell=shell))
    code, said = run_command("results", "postprocess", "-r", str(tmp_path / "results"))
    assert code == 1
    assert "Add `tools/script.sh` to `execution.run_files`" in said

    script = campaign / "_config" / "tools" / "script.sh"
    script.write_text('#!/bin/sh\necho "$2 $3" > "$1/made.txt"\n')
    script.chmod(0o755)
    code, said = run_command("results", "postprocess", "-r", str(tmp_path / "results"))
    assert (code, "run_files" in said) == (0, False)
    assert (campaign / "made.txt").read_text() == "--param value\n"
