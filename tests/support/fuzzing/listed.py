"""Every module that parses something: which reader of the fuzzer covers it, or why none has to."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from support.core_only import ROOT

PARSERS = {
    *(
        "json.load",
        "yaml.load",
        "yaml.parse",
        "yaml.compose",
        "np.load",
        "loads",
        "safe_load",
        "load_all",
        "safe_load_all",
        "parse_yaml",
    ),
    *(
        "read_mapping",
        "model_validate_json",
        "fromstring",
        "iterparse",
        "ParserCreate",
        "XMLParser",
        "XMLPullParser",
    ),
    *("ZipFile", "dotenv_values", "read_csv", "DictReader", "unpack_from", "iter_unpack"),
    *("ZstdDecompressor", "LZ4FrameDecompressor", "decompressobj", "decompress", "make_reader"),
    *("csv.reader", "tarfile.open", "gzip.open", "Image.open", "sqlite3.connect"),
    *("duckdb.connect", "struct.unpack", "model_from_file", "model_from_str", "literal_eval"),
}
"""Functions that parse bytes, by their last name, or their last two where one is too general."""


def parsing_modules() -> Iterator[str]:
    """The modules of `src` and `cli` that call a parser."""
    for top in ("src", "cli"):
        for path in sorted((ROOT / top).rglob("*.py")):
            if _parses(path):
                name = path.relative_to(ROOT / top).with_suffix("").as_posix()
                yield name.removeprefix("robovast/").removeprefix("robovast_cli/")


def _parses(path: Path) -> bool:
    calls = (
        node.func for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)
    )
    return any(not PARSERS.isdisjoint(_names(function)) for function in calls)


def _names(function: ast.expr) -> set[str]:
    words = ast.unparse(function).split(".")
    return {words[-1], ".".join(words[-2:])}


COVERED: dict[str, tuple[str, ...]] = {
    "document": (
        *("model/scenario", "model/document/search/section", "base/yaml_files"),
        "model/variations/parameter_variation",
    ),
    "floorplan": ("navigation/floorplan/parser",),
    "map": ("navigation/map_files",),
    "verdict": ("base/xml_files",),
    "archive": ("campaign/archive",),
    "project": ("base/environment",),
    "bag": (
        "analysis/bags/files",
        "analysis/bags/mcap_file",
        "analysis/bags/zstd",
        "base/sqlite_files",
    ),
    "drive-tables": ("analysis/bags/table",),
    "drive": (
        "evaluation/drive/motion",
        "evaluation/drive/picture_size",
    ),
    "records": (
        *("campaign/run_files", "campaign/run_record", "kubeapi/pod_contract/messages"),
        "storage/bucket_ownership",
    ),
    "postprocess": (
        *("analysis/provenance/drawing", "analysis/provenance/reading", "analysis/provenance/runs"),
        *("analysis/provenance/writing", "analysis/tables/campaign_store"),
        *("analysis/tables/columnar", "analysis/tables/csv_files", "analysis/tables/sqlite_tables"),
        *("analysis/postprocessing/child", "analysis/postprocessing/content"),
        "analysis/postprocessing/state",
    ),
    "campaign": (
        *("analysis/provenance/metadata", "analysis/provenance/searches", "analysis/tables/query"),
        *("campaign/configurations", "campaign/merge", "search/history"),
        *("search/local", "search/store"),
    ),
    "page": (
        *("evaluation/campaign_inputs", "evaluation/configuration_index"),
        *("evaluation/map_picture", "evaluation/notebooks/workloads"),
        *("evaluation/poses", "evaluation/server/searches"),
        "evaluation/untrusted_data",
    ),
}
"""Modules of `robovast` by the reader that makes them parse mutated files."""
TRUSTED: dict[str, tuple[str, ...]] = {
    "an answer of the user's own cluster, or an object that its API server validated": (
        *("agent/campaign", "agent/composed", "agent/notify", "agent/reusable_runs", "agent/pack"),
        *("kubeapi/cluster_config/capacity", "kubeapi/pod_contract/packed"),
        *("kubeapi/pod_contract/pod_facts", "kubeapi/submission", "kube/api", "kube/planned_runs"),
        *("kube/runs", "commands/exec/cluster/chart"),
    ),
    "what this process, or a child that it started, wrote": (
        *(
            "base/serialization",
            "base/task_record",
            "analysis/postprocessing/worker",
            "evaluation/notebooks/child",
            "mcp/question",
        ),
        *("execution/local/scenario_syntax", "analysis/minimise/record"),
        *("kubeapi/cluster_config/base", "storage/compressing", "rosbags_common"),
        "analysis/postprocessing/builtin",
    ),
    "an answer of a server that the user chose; what is wrong in it is tested next to its client": (
        *("analysis/publication/zenodo", "storage/download"),
        *("storage/http_client", "storage/shares/gcs"),
    ),
    "what pip wrote when it installed this package": ("base/installation",),
    "what the user types, or a file that they name": (
        *("commands/results/search", "commands/exec/cluster/setup"),
        "evaluation/server/launches",
    ),
    "notebooks get the errors of Python, as the original RoboVAST raises them": (
        *("analysis/notebooks/common", "analysis/notebooks/ros2", "common/campaign_data"),
    ),
    "inside the container of the run": ("execution/contract/run_scenarios",),
    "by `read_mapping`, which the readers `postprocess` and `campaign` cover": (
        *("analysis/publication/context", "analysis/publication/zip_archive"),
        *("analysis/replay/outputs", "execution/local/__init__", "execution/local/continuing"),
        *("execution/local/edited_inputs", "execution/local/replay"),
    ),
}
"""Modules that need no reader of their own, by the reason."""
