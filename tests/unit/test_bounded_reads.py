"""Whole files are read with a bound, so that a sparse file of terabytes takes no memory."""

from __future__ import annotations

import ast
import os
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.core_only import ROOT

from robovast.base.errors import InputError
from robovast.base.file_errors import read_content, read_text

UNBOUNDED = {
    "files that Kubernetes mounts, at most 1 MiB": {
        *("agent/pod_facts", "agent/sources", "agent/campaign", "agent/notify", "agent/share"),
        *("kubeapi/pod_contract/messages", "storage/endpoint", "kube/api"),
    },
    "files of this package, of the system, or of a child of this process": {
        *("evaluation/server/app", "evaluation/server/rerun", "evaluation/notebooks/child"),
        *("base/task_record", "analysis/provenance/query", "execution/contract/collect_sysinfo"),
        "base/installation",
        *("execution/contract/monitor_resources", "execution/contract/run_scenarios"),
        *("execution/local/process_tree", "execution/local/process_environment"),
        *(
            "execution/local/process_runtime",
            "execution/local/prepare",
            "planning/separate_processes",
        ),
        *("pods/templates", "ui/campaign_report/html", "rosbags_common"),
    },
    "standard input, or the answer of a server that the user chose": {
        *("commands/results/sparql", "commands/results/query", "storage/s3"),
    },
}
"""Modules that read whole files in other ways, by the reason."""


def unbounded_reads() -> Iterator[str]:
    """Modules with a call of `read_text`, `read_bytes` or `read()` of an object."""
    for top in ("src/robovast", "operator/robovast_operator", "cli/robovast_cli", "src"):
        folder = ROOT / top
        for path in folder.glob("*.py") if top == "src" else folder.rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                match node:
                    case ast.Call(func=ast.Attribute(attr="read_text" | "read_bytes")):
                        yield path.relative_to(folder).with_suffix("").as_posix()
                    case ast.Call(func=ast.Attribute(attr="read"), args=[], keywords=[]):
                        yield path.relative_to(folder).with_suffix("").as_posix()


def test_files_from_elsewhere_are_read_by_the_bounded_readers() -> None:
    assert set(unbounded_reads()) == set().union(*UNBOUNDED.values())


@pytest.mark.parametrize("read", [read_content, read_text])
def test_a_file_that_the_user_named_is_read_through_links(tmp_path: Path, read: object) -> None:
    (tmp_path / "real").write_text("text")
    (tmp_path / "link").symlink_to("real")
    assert read(tmp_path / "link") in ("text", b"text")  # type: ignore[operator]


@pytest.mark.parametrize("read", [read_content, read_text])
def test_a_small_file_takes_little_memory(tmp_path: Path, read: object) -> None:
    (tmp_path / "small").write_text("text")
    tracemalloc.start()
    try:
        read(tmp_path / "small")  # type: ignore[operator]
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 1 << 20


@pytest.mark.parametrize("read", [read_content, read_text])
def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path, read: object) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("pipe")
    for name in ("pipe", "link"):
        with pytest.raises(InputError, match="is not a regular file"):
            read(tmp_path / name)  # type: ignore[operator]
