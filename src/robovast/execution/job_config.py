"""Creates the inputs of a job: config folder, parameter documents and environment."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robovast.base import safe_paths
from robovast.base.serialization import dump_yaml_documents
from robovast.campaign.layout import JOBS
from robovast.model.plan import PackStart, Run
from robovast.model.scenario import SEED, Scenario

PARAMETER_FILE = "scenario.params.yaml"
SEEDS_FILE = "scenario.seeds.json"
"""Seeds of runs by their folder below `/out`."""
SEED_VARIABLE = "ROBOVAST_SEED"


def is_pack(job: PackStart) -> bool:
    """Whether a job has several runs, each with its own output folder."""
    return len(job.runs) > 1


def parameter_documents(job: PackStart, scenario: Scenario) -> str:
    """One YAML document per run: `{scenario: {parameter: value, _output_dir: …}}`."""
    return dump_yaml_documents({scenario.name: _parameters(job, run, scenario)} for run in job.runs)


def _parameters(job: PackStart, run: Run, scenario: Scenario) -> dict[str, Any]:
    given = {k: v for k, v in run.variant.parameters.items() if not k.startswith("_")}
    seed = {SEED: run.seed} if scenario.takes_seed and run.seed is not None else {}
    return {**seed, **given, "_output_dir": run.path if is_pack(job) else "."}


def build_config_folder(folder: Path, common: Path, job: PackStart, scenario: Scenario) -> None:
    """Fill a job's config folder with links to shared files and copies of its variants' files.

    Args:
        folder: the folder to create.
        common: a private copy of the shared files, on the same file system.
        job: the job; its variants' files of one name have equal content.
        scenario: of the document.
    """
    shutil.copytree(common, folder, copy_function=link_or_copy)
    for run in job.runs:
        for file in run.variant.files:
            safe_paths.copy_file(file.source, folder / file.name, folder)
    (folder / PARAMETER_FILE).write_text(parameter_documents(job, scenario), encoding="utf-8")
    seeds = {run.path: run.seed for run in job.runs if run.seed is not None}
    (folder / SEEDS_FILE).write_text(json.dumps(seeds), encoding="utf-8")


def link_or_copy(source: str, target: str) -> None:
    """Create a hard link, or a copy if the file system supports no hard links."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def job_environment(
    job: PackStart,
    *,
    campaign: str,
    scenario_file: str,
    config_dir: str,
    out_dir: str,
    available_cpus: float,
    available_memory: int,
    settings: Mapping[str, str | None],
    scenario_options: str,
    user: Mapping[str, str],
) -> dict[str, str]:
    """The environment of the run contract (docs/reference/container-interface.md).

    Args:
        job: the job.
        campaign: name of the campaign's folder.
        scenario_file: path of the scenario below the config folder.
        config_dir: path of the config folder inside the run.
        out_dir: path of the output folder inside the run.
        available_cpus: CPUs of the main container.
        available_memory: memory of the main container [byte].
        settings: PRE_COMMAND, POST_COMMAND and SIMULATION of the document.
        scenario_options: further options of scenario-execution, such as `-t -d`.
        user: variables of the document.
    """
    environment = {
        "LIBGL_ALWAYS_SOFTWARE": "1",
        **user,
        "CAMPAIGN_ID": campaign,
        "SCENARIO_FILE": scenario_file,
        "SCENARIO_PARAMETER_FILE": PARAMETER_FILE,
        "OUTPUT_RESULT_PER_SCENARIO": "true",
        **own_environment(job, out_dir),
        "SCENARIO_EXECUTION_PARAMETERS": scenario_options,
        "AVAILABLE_CPUS": f"{available_cpus:g}",
        "AVAILABLE_MEM": str(available_memory),
        "ROBOVAST_CONFIG_DIR": config_dir,
        "ROBOVAST_OUT_DIR": out_dir,
    }
    return environment | {name: value for name, value in settings.items() if value}


def own_environment(job: PackStart, out_dir: str) -> dict[str, str]:
    """The part of a job's environment that is not that of all jobs: output folders and seed.

    What serves several runs, such as a secondary container, has none of their seeds.
    """
    own = {"OUTPUT_DIR": f"{out_dir}/{JOBS}/{job.name}", "SCENARIO_OUTPUT_DIR": out_dir}
    if is_pack(job):
        return own
    run = job.runs[0]
    seed = {SEED_VARIABLE: str(run.seed)} if run.seed is not None else {}
    return {**own, "SCENARIO_OUTPUT_DIR": f"{out_dir}/{run.path}", **seed}
