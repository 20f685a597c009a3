"""Prepares the runs of a pod, while its other containers wait.

These are of the user's image, which may have put anything into `out` meanwhile.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from robovast.agent.campaign import (
    PodCampaign,
    bad_runs,
    expand,
    fetch_variant_files,
    load_inputs,
    open_campaign,
    open_composed,
)
from robovast.agent.claims import claim_job, hopeless
from robovast.agent.container_control import RunContainer
from robovast.agent.job_files import prepare_output, write_environment, write_parameters
from robovast.agent.mounts import Folders
from robovast.agent.pack import Deciding, Pack
from robovast.agent.results import PodResults
from robovast.agent.scripts import FOLDER, START
from robovast.base.errors import InputError
from robovast.execution.contract import contract_files
from robovast.execution.generate import copy_file
from robovast.execution.job_config import build_config_folder, job_environment
from robovast.kubeapi.pod_contract.exit_codes import AgentExit, PlanError
from robovast.kubeapi.pod_contract.pack_request import PackRequest
from robovast.model.document import Document
from robovast.model.document.section import merge_pairs
from robovast.model.expansion import Variant
from robovast.model.inputs import container_files
from robovast.model.plan import PackStart, Run, planned_run
from robovast.model.quantities import machine_cpus, machine_memory
from robovast.model.scenario import read_scenario
from robovast.storage.bucket_names import REUSE_BUCKET


def prepare(folders: Folders, request: PackRequest) -> AgentExit:
    """Prepare the first job of a pod and order it; if nothing is left to run, order the end.

    Raises:
        PlanError: there is no such pack.
        InputError: the document, or a file that it needs, is wrong.
        StorageError: the bucket cannot be read.
        OSError: the pod's disk cannot be written.
    """
    campaign = open_campaign(folders)
    looking = request.run is not None  # into it: nothing is claimed, taken over or stored
    if not looking:
        campaign.bucket.claim()
    number, ids = _chosen(campaign, request)
    document, variants = _variants(campaign)
    runs = [_run(campaign, variants, id_) for id_ in ids]
    pack = _pack(campaign, document, request, number, runs)
    pack = (
        dataclasses.replace(pack, done={}, deciding=None) if looking else _claimed(campaign, pack)
    )
    if pack.first is not None:
        left = [run for run in runs if run.id not in pack.done]
        if campaign.plan.expansion != "pure":
            for variant in {run.variant.name: run.variant for run in left}.values():
                fetch_variant_files(campaign, variants, variant)
        common = _common_files(campaign, document)
        if campaign.plan.reuse and not looking:
            environment = _environment(campaign, document, pack.first)
            pack = _reusing(campaign, document, pack, left, environment, common)
    job = pack.first
    container = RunContainer(folders)
    if job is not None:
        container.prepare()
        pack = dataclasses.replace(pack, environment=_environment(campaign, document, job))
        _fill_config(campaign, pack, [run for run in left if run.id not in pack.done], common)
        prepare_output(folders, job)
        write_environment(folders, pack.environment)
    pack.write(folders.pack)
    if job is None:
        container.end()
    else:
        container.run(1)
        _let_begin(folders)
    return AgentExit.PASSED


def _chosen(campaign: PodCampaign, request: PackRequest) -> tuple[int, Sequence[int]]:
    """Number of the pod's pack, and the ids of its runs."""
    bad = partial(bad_runs, campaign.store, campaign.plan.bucket)
    try:
        return request.chosen(campaign.packs, bad)
    except (IndexError, ValueError) as error:
        raise PlanError(
            f"completion index {request.index}: the plan has no such runs: {error}"
        ) from error


def _variants(campaign: PodCampaign) -> tuple[Document, Sequence[Variant]]:
    if campaign.plan.expansion != "pure":
        return open_composed(campaign)
    document = load_inputs(campaign)
    return document, expand(campaign.plan, document, campaign.folders.scratch, print).variants


def _run(campaign: PodCampaign, variants: Sequence[Variant], id_: int) -> Run:
    index, _ = campaign.packs.run(id_)
    if index >= len(variants):
        raise PlanError(
            f"run {id_} is of configuration {index}, the document has {len(variants)} only: plan "
            "and document are not of one campaign."
        )
    return planned_run(campaign.packs, variants, id_, campaign.plan.seed)


def _pack(
    campaign: PodCampaign,
    document: Document,
    request: PackRequest,
    number: int,
    runs: Sequence[Run],
) -> Pack:
    plan, execution = campaign.plan, document.vast.execution
    bucket = campaign.bucket
    first_job = bucket.first_free_job(number)
    touched = first_job > 1
    return Pack(
        campaign=plan.campaign,
        bucket=plan.bucket,
        owner=plan.owner,
        image=plan.image,
        number=number,
        attempt=request.attempt,
        runs=tuple(_without_files(run) for run in runs),
        done=bucket.verdicts(runs, request.attempt) if touched else {},
        first_job=first_job,
        scenario=read_scenario(document.scenario),
        timeout=execution.timeout,
        secondaries=tuple(container.name for container in execution.secondary_containers),
        environment={},
        deciding=_deciding(campaign, document, request, runs),
    )


def _deciding(
    campaign: PodCampaign, document: Document, request: PackRequest, runs: Sequence[Run]
) -> Deciding | None:
    """What decides how many of these runs are needed; None if all are."""
    variant, _ = campaign.packs.run(runs[0].id)
    numbers = campaign.packs.numbers_of(variant)
    test = document.vast.execution.test(len(numbers))
    if test is None or not campaign.packs.by_variant:
        return None
    own = {run.number for run in runs}
    read = [number for number in numbers if number not in own or request.attempt > 1]
    name, record = runs[0].variant.name, campaign.bucket.record
    stored = {number: found for number in read if (found := record(f"{name}/{number}"))}
    others = {n: found.verdict for n, found in stored.items() if n not in own}
    again = tuple(n for n, found in stored.items() if n in own and found.attempt < request.attempt)
    return Deciding(test, campaign.packs.runs_per_job, others, again)


def _claimed(campaign: PodCampaign, pack: Pack) -> Pack:
    """Claim the pack's first job for this pod, without a run that ends every pod.

    This writes into the bucket: a server that refuses is noticed before anything is executed.
    """
    stuck = hopeless(campaign.bucket, pack)
    if stuck is not None:
        folder = campaign.folders.scratch / "nothing"
        folder.mkdir(parents=True, exist_ok=True)
        record = PodResults(campaign.bucket, pack, pod="").store_run(
            dataclasses.replace(stuck, folder=folder)
        )
        pack = dataclasses.replace(pack, done={**pack.done, stuck.run.id: record.verdict})
    if pack.first is None:
        return pack
    return dataclasses.replace(pack, first_job=claim_job(campaign.bucket, pack, pack.first))


def _reusing(
    campaign: PodCampaign,
    document: Document,
    pack: Pack,
    left: Sequence[Run],
    environment: Mapping[str, str],
    common: Path,
) -> Pack:
    """The pack without the runs that others have executed with the same keys.

    A repetition executes its runs, whatever is stored.
    """
    from robovast.agent.reuse import key_parts, take_over  # most campaigns reuse nothing

    parts = key_parts(campaign, document, pack.scenario, left, environment, common)
    pack = dataclasses.replace(pack, keys=parts)
    if pack.keys is not None:
        campaign.store.make_bucket(REUSE_BUCKET)
    while pack.keys is not None and pack.attempt == 1 and pack.first is not None:
        verdicts = take_over(campaign, pack, pack.first)
        if not verdicts:
            break
        done = {**pack.done, **verdicts}
        pack = dataclasses.replace(pack, done=done, first_job=pack.first_job + 1)
        pack = _claimed(campaign, pack)
    return pack


def _without_files(run: Run) -> Run:
    light = dataclasses.replace(run.variant, files=(), variations=(), extra={})
    return dataclasses.replace(run, variant=light)


def _environment(campaign: PodCampaign, document: Document, job: PackStart) -> dict[str, str]:
    plan, execution = campaign.plan, document.vast.execution
    return job_environment(
        job,
        campaign=plan.campaign,
        scenario_file=document.vast.scenario_file or "",
        config_dir=campaign.folders.config_seen,
        out_dir=campaign.folders.out_seen,
        available_cpus=plan.cpus or machine_cpus(),
        available_memory=plan.memory or machine_memory(),
        settings={
            "PRE_COMMAND": execution.pre_command,
            "POST_COMMAND": execution.post_command,
            "SIMULATION": execution.simulation,
        },
        scenario_options=plan.options,
        user=merge_pairs(execution.env),
    )


def _common_files(campaign: PodCampaign, document: Document) -> Path:
    """A folder of the files that all runs share."""
    common = campaign.folders.scratch / "common"
    for path in container_files(document):
        copy_file(document.folder / path, common / path)
    for script in contract_files():
        copy_file(script, common / script.name)
    return common


def _fill_config(campaign: PodCampaign, pack: Pack, left: Sequence[Run], common: Path) -> None:
    """Fill the folder of inputs.

    Raises:
        InputError: one is called as our own folder.
    """
    folders = campaign.folders
    made = folders.scratch / "config"
    build_config_folder(made, common, PackStart(0, tuple(left)), pack.scenario)
    for path in made.iterdir():
        if path.name == FOLDER:
            raise InputError(
                f"{FOLDER}: this name among a run's inputs is RoboVAST's", hint="rename it"
            )
        os.rename(path, folders.config / path.name)
    if pack.first is not None:  # which may have some of the runs only
        write_parameters(folders, pack.first, pack.scenario)


def _let_begin(folders: Folders) -> None:
    """Put start.sh in place, for which the run's containers wait: nothing may follow."""
    copy = folders.scratch / START.name
    copy_file(START, copy)
    os.rename(copy, folders.orders / START.name)
