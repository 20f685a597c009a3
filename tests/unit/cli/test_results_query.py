"""`vast results query`, as a user sees it."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from pathlib import Path

from support.campaigns.finished import finished_campaign
from support.patience import PATIENCE, eventually

from robovast.analysis.tables.columnar import update_columnar
from robovast.campaign.layout import Layout

ENDLESS = "SELECT count(*) FROM range(10000000) a, range(1000000) b WHERE a.range % 7 = b.range % 3"


def catches_ctrl_c(process: int) -> bool:
    """Whether a process has a handler for SIGINT."""
    status = Path(f"/proc/{process}/status").read_text()
    (caught,) = re.findall(r"^SigCgt:\s*(\w+)$", status, re.MULTILINE)
    return bool(int(caught, 16) & 1 << signal.SIGINT - 1)


NUMBERS = "'Infinity'::double AS a, '-Infinity'::double AS b, 'NaN'::double AS c, NULL AS d"


def test_json_tells_numbers_without_digits_from_no_value(vast, tmp_path: Path) -> None:
    update_columnar(Layout(finished_campaign(tmp_path, 1)), {"c-1/0": "1"})
    sql = f"SELECT {NUMBERS}, ['Infinity'::double, 1] AS e, {{'x': 'NaN'::double}} AS f"
    outcome = vast("results", "query", sql, "-o", "json", "-r", str(tmp_path))
    (row,) = json.loads(outcome.out, parse_constant=lambda text: f"not valid: {text}")
    assert [row[name] for name in "abcd"] == ["Infinity", "-Infinity", "NaN", None]
    assert (row["e"], row["f"]) == (["Infinity", 1.0], {"x": "NaN"})


def test_ctrl_c_ends_a_query_at_once(tmp_path: Path) -> None:
    update_columnar(Layout(finished_campaign(tmp_path, 1)), {"c-1/0": "1"})
    with subprocess.Popen(
        [sys.executable, "-m", "robovast_cli", "results", "query", "-", "-r", str(tmp_path)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        try:
            assert process.stdin is not None
            eventually(lambda: catches_ctrl_c(process.pid), told="Python does not begin")
            process.stdin.write(ENDLESS.encode())
            process.stdin.close()
            eventually(lambda: not catches_ctrl_c(process.pid), told="the query does not begin")
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE) == -signal.SIGINT
            assert process.stderr is not None
            assert process.stderr.read() == b""
        finally:
            process.kill()
