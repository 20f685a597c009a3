"""`prepare-run`: writes a folder whose `run.sh` needs Docker or Podman, but not RoboVAST."""

from __future__ import annotations

import dataclasses
import shlex
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from robovast.base.errors import CannotRunError, StorageError
from robovast.base.file_errors import refuse_obstacle, writing
from robovast.base.serialization import dump_yaml
from robovast.campaign.configurations import with_stored_files
from robovast.campaign.layout import Layout
from robovast.common.execution import COMPAT_VERSION
from robovast.execution.contract import contract_files
from robovast.execution.generate import copy_file, write_configurations
from robovast.execution.job_config import build_config_folder
from robovast.execution.local.choose import resolve_image
from robovast.execution.local.container_runtime import X11_SOCKETS, ContainerRuntime
from robovast.execution.local.docker_compose import MAIN, compose_model
from robovast.execution.local.events import LocalOptions
from robovast.execution.local.limits import check_limits
from robovast.execution.local.runtime import RuntimeIdentity
from robovast.execution.local.session import Session
from robovast.execution.local.variants import campaign_seed, choose_variants
from robovast.model.document import Document
from robovast.model.inputs import container_files
from robovast.model.naming import campaign_prefix
from robovast.model.plan import PackStart, pack_runs, plan_runs, plan_variants

_TEMPLATE = Path(__file__).with_name("run.sh.in")


def prepare_run(document: Document, output: Path, options: LocalOptions) -> Path:
    """Write everything that `run.sh` needs to a folder; return the script's path.

    The folder contains `run.sh`, `out_template/` (the campaign before its first run) and
    `jobs/<job>/` with each job's config folder and compose file.

    Raises:
        InputError: the document cannot be expanded, or nothing matches `options.select`.
        StorageError: the folder cannot be written, or holds something else.
    """
    check_limits(document)
    output = output.absolute()
    _make_room(output)
    with TemporaryDirectory(prefix="robovast-") as scratch:
        composition = choose_variants(document, Path(scratch), options, _silent)
        template = Layout(output / "out_template")
        write_configurations(document, composition, template.root, timings=True)
        execution = document.vast.execution
        runs = options.runs or execution.most_runs
        variants = [with_stored_files(template, variant) for variant in composition.variants]
        plan = plan_variants(variants, runs, execution.runs_per_start)
        jobs = pack_runs(plan, plan_runs(plan, variants, campaign_seed(document)))
        _write_jobs(document, options, output, jobs, Path(scratch))
    (output / "gui.yaml").write_text(dump_yaml(_gui(document)), encoding="utf-8")
    return _write_script(document, output, options)


def open_shell(document: Document, options: LocalOptions) -> int:
    """Open a shell in the container of the first run, with its inputs mounted.

    Returns:
        The shell's exit code.

    Raises:
        CannotRunError: the runtime has no containers.
    """
    if options.runtime == "process":
        raise CannotRunError(
            "`--start-only` needs containers", hint="use `--runtime docker` or `podman`"
        )
    with TemporaryDirectory(prefix="robovast-") as folder:
        script = prepare_run(document, Path(folder), dataclasses.replace(options, runs=1))
        flags = {"--no-gui": options.gui is False, "--network-host": options.network_host}
        chosen = [flag for flag, given in flags.items() if given]
        return subprocess.run([script, "--shell", *chosen], check=False).returncode


def _silent(message: str) -> None:
    del message


def _make_room(output: Path) -> None:
    """Remove the output of an earlier prepare-run, but neither results nor other files."""
    refuse_obstacle(output)
    with writing(output):
        if output.is_dir() and any(output.iterdir()) and not (output / "run.sh").is_file():
            raise StorageError(
                f"{output} holds other files", hint="choose an empty or a new folder"
            )
        output.mkdir(parents=True, exist_ok=True)
        for name in ("out_template", "jobs"):
            shutil.rmtree(output / name, ignore_errors=True)


def _write_jobs(
    document: Document, options: LocalOptions, output: Path, jobs: list[PackStart], scratch: Path
) -> None:
    common = scratch / "common"
    for path in container_files(document):
        copy_file(document.folder / path, common / path)
    for script in contract_files():
        copy_file(script, common / script.name)
    image = resolve_image(document, options) or ""
    runtime = ContainerRuntime("docker", image, options, _silent)
    session = Session(document, Layout(output), options, runtime, RuntimeIdentity(image, ""))
    for job in jobs:
        folder = output / "jobs" / job.name
        build_config_folder(folder / "config", common, job, session.scenario)
        (folder / "runs").write_text("".join(f"{run.path}\n" for run in job.runs), "utf-8")
        compose_file = dump_yaml(_compose_model(session, job, folder))
        (folder / "compose.yaml").write_text(compose_file, encoding="utf-8")


def _compose_model(session: Session, job: PackStart, folder: Path) -> dict[str, Any]:
    """The job's compose file; values that `run.sh` determines are variables."""
    spec = session.spec(job, folder)
    model = compose_model(
        name=None,
        image="${ROBOVAST_IMAGE}",
        environment=spec.environment,
        volumes=["./config:/config:ro", "${ROBOVAST_OUT}:/out"],
        user="${ROBOVAST_USER}",
        limits=spec.limits,
        secondaries=spec.secondaries,
        network_mode="${ROBOVAST_NETWORK}",
        labels={},
    )
    for service in model["services"].values():
        service["environment"]["CAMPAIGN_ID"] = "${CAMPAIGN_ID}"
        service["environment"]["SCENARIO_EXECUTION_PARAMETERS"] = "${ROBOVAST_SCENARIO_OPTIONS}"
    return model


def _gui(document: Document) -> dict[str, Any]:
    """Additions for machines with a display."""
    service = {
        "environment": {"DISPLAY": "${DISPLAY}"},
        "volumes": [f"{X11_SOCKETS}:{X11_SOCKETS}"],
    }
    names = [MAIN, *(c.name for c in document.vast.execution.secondary_containers)]
    return {"services": dict.fromkeys(names, service)}


def _write_script(document: Document, output: Path, options: LocalOptions) -> Path:
    execution = document.vast.execution
    own_user = "run_as_user" in execution.model_fields_set
    flags = {"-t": options.log_tree, "-d": options.debug}
    values = {
        "COMPAT_VERSION": str(COMPAT_VERSION),
        "IMAGE": shlex.quote(resolve_image(document, options) or ""),
        "CAMPAIGN": shlex.quote(campaign_prefix(document.vast.campaign_name, "._-")),
        "OPTIONS": " ".join(flag for flag, given in flags.items() if given),
        "USER": str(execution.run_as_user) if own_user else "",
    }
    text = _TEMPLATE.read_text(encoding="utf-8")
    for name, value in values.items():
        text = text.replace(f"@{name}@", value)
    script = output / "run.sh"
    script.write_text(text, encoding="utf-8")
    script.chmod(0o755)
    return script
