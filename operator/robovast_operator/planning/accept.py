"""Checks a Campaign object: the result is an executable campaign, or the cause of its rejection."""

from __future__ import annotations

import binascii
import hashlib
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from pydantic import ValidationError

from robovast.base.containers import named_digest
from robovast.base.errors import DocumentError, RobovastError
from robovast.base.serialization import dump_yaml
from robovast.base.yaml_files import parse_yaml
from robovast.campaign.configurations import variants_digest
from robovast.kubeapi.amounts import check_amounts
from robovast.kubeapi.pod_contract.messages import Composed
from robovast.kubeapi.resources import CampaignSpec, Scheduling
from robovast.kubeapi.secret_names import refusal
from robovast.kubeapi.source_files import Files, check_paths
from robovast.model.document.loader import Document, check_source
from robovast.model.document.model import Vast
from robovast.model.document.source import Source
from robovast.model.expansion import Variant, compose, select_any
from robovast.model.expansion.expand import DEFAULT_ENTRY
from robovast.model.packs import RUNS_LIMIT, CampaignPlan, Entry, format_breaks, is_breaks
from robovast.model.plan import breaks
from robovast.model.variations.loader import all_pure
from robovast_operator.kube.objects import Identity, Object
from robovast_operator.kube.sentences import sentence, with_remedy
from robovast_operator.planning.campaign import Accepted, Rejected
from robovast_operator.planning.configurations import spec_message
from robovast_operator.settings import OperatorSettings

FIX_DOCUMENT = "Fix the .vast file and apply the Campaign again."


def metadata_refusal(scheduling: Scheduling, settings: OperatorSettings) -> str:
    """Return the refusal of pod annotations and labels that are not allowed; empty without any."""
    for place, value, keys, allowed in (
        ("podAnnotations", "annotations", scheduling.pod_annotations, settings.pod_annotations),
        ("podLabels", "labels", scheduling.pod_labels, settings.pod_labels),
    ):
        refused = sorted(keys.keys() - set(allowed))
        if refused:
            return (
                f"The Campaign may not set `{refused[0]}` in spec.scheduling.{place}. Allowed keys "
                f"are: {', '.join(sorted(allowed)) or 'none'}. Ask your cluster administrator to "
                f"allow further keys with the chart value `policies.podMetadata.{value}`."
            )
    return ""


def accept(obj: Object, files: Files | None, settings: OperatorSettings) -> Accepted | Rejected:
    """Check a Campaign as far as possible without running code of the user.

    Args:
        obj: the Campaign.
        files: its input files, None when they are in S3 or Git.
        settings: of the installation.
    """
    identity = Identity.of(obj)
    try:
        spec = CampaignSpec.model_validate(obj["spec"])
        mounted = spec.model_copy(update={"notifications": []})  # runs do not depend on those
        refused = refusal(mounted, settings.secret_names)
        if refused:
            return Rejected("SecretNotAllowed", sentence(f"The Campaign is rejected: {refused}"))
        refused = metadata_refusal(spec.scheduling, settings)
        if refused:
            return Rejected("PodMetadataNotAllowed", refused)
        text = _document_text(spec, identity, files)
        if files is None:
            vast = _validate_alone(spec)
            return _accepted(identity, spec, vast, text, settings)
        with tempfile.TemporaryDirectory() as folder:
            made = _checked(Path(folder), identity, spec, text, files, settings)
        if isinstance(made, Rejected):
            return made
        return replace(made, inputs=_digests(files, made.document_name))
    except ValidationError as error:
        return _invalid_spec(spec_message(error))
    except DocumentError as error:
        return invalid_document(str(error))
    except RobovastError as error:
        return _invalid(str(error))
    except RecursionError:
        return _invalid_spec("spec.vast is nested too deeply")
    except (ValueError, binascii.Error) as error:
        return _invalid_spec(str(error))


def invalid_document(problems: str) -> Rejected:
    """Return the rejection of a Campaign whose document is invalid."""
    message = with_remedy("The .vast file is invalid", problems, FIX_DOCUMENT)
    return Rejected("InvalidDocument", message)


def _invalid_spec(problems: str) -> Rejected:
    remedy = "Fix the spec and apply the Campaign again."
    message = with_remedy("The spec of the Campaign is invalid", problems, remedy)
    return Rejected("InvalidSpec", message)


def _invalid(problems: str) -> Rejected:
    remedy = "Fix the cause and apply the Campaign again."
    return Rejected("Invalid", with_remedy("The Campaign is invalid", problems, remedy))


def _digests(files: Files, document: str) -> dict[str, str]:
    """Return the SHA-256 of the files next to the document; the plan contains the document."""
    others = {path: content for path, content in files.items() if path != document}
    return {path: hashlib.sha256(content).hexdigest() for path, content in others.items()}


def _document_text(spec: CampaignSpec, identity: Identity, files: Files | None) -> str:
    """Return the document as the user wrote it, if among the files; else from the spec.

    Only the file keeps comments and numbers: the API turns `1.0` into `1`.
    """
    name = spec.document or f"{identity.name}.vast"
    written = (files or {}).get(name)
    if written is not None:
        try:
            if parse_yaml(written) == spec.vast:
                return written.decode()
        except ValueError:
            pass  # the spec takes precedence over the file
    return dump_yaml(spec.vast)


def _validate_alone(spec: CampaignSpec) -> Vast:
    return Vast.model_validate(spec.vast)


def _checked(
    folder: Path,
    identity: Identity,
    spec: CampaignSpec,
    text: str,
    files: Files,
    settings: OperatorSettings,
) -> Accepted | Rejected:
    """Check a document with available files, as the command line does."""
    check_paths(files)
    for path, content in files.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
    name = spec.document or f"{identity.name}.vast"
    if not all_pure(spec.vast) or spec.vast.get("search") is not None:
        return _accepted(identity, spec, Vast.model_validate(spec.vast), text, settings)
    try:
        document = check_source(Source(folder / name, text))
        accepted = _accepted(identity, spec, document.vast, text, settings)
        return accepted if isinstance(accepted, Rejected) else _expanded(document, accepted)
    except RobovastError as error:
        problems = str(error).replace(f"{folder}/", "")
        return (
            invalid_document(problems) if isinstance(error, DocumentError) else _invalid(problems)
        )


def _expanded(document: Document, accepted: Accepted) -> Accepted | Rejected:
    with tempfile.TemporaryDirectory() as output:
        variants = list(compose(document, Path(output)).variants)
    variants = select_any(variants, accepted.spec.select)
    by_entry: dict[str, list[Variant]] = {}
    for variant in variants:
        by_entry.setdefault(variant.entry, []).append(variant)
    entries = tuple(
        Entry(name=name, variants=len(found), digest=variants_digest(found))
        for name, found in by_entry.items()
    )
    cuts = format_breaks(breaks(variants))
    return _planned(replace(accepted, pure=True, entries=entries, breaks=cuts))


def _planned(accepted: Accepted) -> Accepted | Rejected:
    """Return a campaign with its expansion, or the rejection if there are too many runs."""
    total = sum(entry.variants for entry in accepted.entries) * accepted.runs
    if total <= RUNS_LIMIT:
        return accepted
    message = (
        f"The campaign would have {total:,} runs, but at most {RUNS_LIMIT:,} are allowed. Lower "
        "`execution.runs`, or split the campaign."
    )
    return Rejected("TooManyRuns", message)


def _accepted(
    identity: Identity, spec: CampaignSpec, vast: Vast, text: str, settings: OperatorSettings
) -> Accepted | Rejected:
    """Check what needs no files: limits, image, resources."""
    image = spec.image or vast.execution.image
    if not image:
        message = "The .vast file names no image. Set `execution.image`."
        return Rejected("NoImage", message)
    if vast.search is not None and spec.select:
        message = "A search has no configurations to select. Remove spec.select."
        return Rejected("InvalidSpec", message)
    if spec.reuse and not {"*", identity.namespace} & set(settings.reuse_namespaces):
        return Rejected(
            "ReuseNotAllowed",
            f"Campaigns in namespace {identity.namespace} cannot reuse runs. Remove spec.reuse "
            "(`--reuse`), or ask your cluster administrator to add the namespace to the chart "
            "value policies.reuseNamespaces.",
        )
    why = _not_reusable(spec, vast, image)
    if why:
        return Rejected("InvalidSpec", why)
    check_amounts(vast.execution, spec.cluster or "", settings.work_limit)
    return Accepted(
        identity=identity,
        spec=spec,
        vast=vast,
        document_text=text,
        image=image,
        pure=False,
        default_endpoint=settings.endpoint,
        default_region=settings.region,
    )


def _not_reusable(spec: CampaignSpec, vast: Vast, image: str) -> str:
    """Return why no run can be reused; empty if runs can be reused, or if reuse is not set."""
    if not spec.reuse:
        return ""
    if vast.execution.seed is None:
        return (
            "A campaign with spec.reuse needs a fixed seed. Set `execution.seed` in the .vast file."
        )
    if not named_digest(image):
        return (
            f"A campaign with spec.reuse needs an image with a digest, but {image} has none. Use "
            "IMAGE@sha256:DIGEST."
        )
    for assets in vast.execution.kubernetes.assets:
        if not named_digest(assets.image or ""):
            return (
                f"A campaign with spec.reuse needs assets with a digest, but the assets at "
                f"{assets.path} have none. Use an image: IMAGE@sha256:DIGEST."
            )
    if vast.search is not None:
        return "A search cannot reuse runs of other campaigns. Remove spec.reuse."
    return ""


DOCUMENT_CHANGED = Rejected(
    "DocumentChanged",
    "The field spec.vast has changed after the runs were planned. Only `execution.runs` (or "
    "`execution.runs.max`), and `budget` and `stopping` of a search may change. Undo the change, "
    "or create another Campaign. The planned runs continue.",
)


def source_changed(planned: CampaignPlan | None, accepted: Accepted) -> Rejected | None:
    """Return the rejection of a campaign whose input files differ from the planned ones."""
    before, now = planned.inputs if planned is not None else {}, accepted.inputs
    names = [name for name in before if now.get(name) != before[name]]
    if not names:
        return None
    return Rejected(
        "SourceChanged",
        f"The file `{names[0]}` of spec.source differs from the file that the runs were planned "
        f"with (SHA-256 {before[names[0]]}). Restore the file, or create another Campaign. Runs "
        "that are in progress continue.",
    )


def same_document(planned: str, vast: Mapping[str, object]) -> bool:
    """Return whether a document is the planned one, apart from runs and the end of a search.

    What decides about that number is part of it.
    """
    try:
        before = parse_yaml(planned)
    except ValueError:
        return False
    return isinstance(before, Mapping) and _fixed(before) == _fixed(vast)


def _fixed(vast: Mapping[str, object]) -> dict[str, object]:
    """Return the part of a document that must not change after the first plan."""
    execution, search = vast.get("execution"), vast.get("search")
    if isinstance(search, Mapping):
        kept = {key: value for key, value in search.items() if key not in {"budget", "stopping"}}
        vast = {**vast, "search": kept}
    if not isinstance(execution, Mapping):
        return dict(vast)
    runs = execution.get("runs")
    rule = {k: v for k, v in runs.items() if k != "max"} if isinstance(runs, Mapping) else None
    return {**vast, "execution": {**execution, "runs": rule}}


def failed_task(task: str, error: str | None, reason: str) -> Rejected:
    """Return the rejection of a Campaign whose expansion or search Job failed.

    Args:
        task: `expansion` or `search`.
        error: message of the pod; None if there is none.
        reason: of the failure.
    """
    if not error:
        message = f"The {task} Job ended without a message. Read the log of the {task} Job."
        return Rejected(reason, message)
    if reason == "InvalidDocument":
        return invalid_document(error)
    return Rejected(reason, sentence(error, f"The {task} Job failed: "))


def with_composition(
    accepted: Accepted, composed: Composed | str | None, limit: int, reason: str
) -> Accepted | Rejected:
    """Return a campaign with the result of its compose Job, or the rejection.

    Args:
        accepted: the campaign.
        composed: message of the Job's pod, which users' plugins may have influenced.
        limit: most variants of a document.
        reason: why the Job failed, in one word.
    """
    if not isinstance(composed, Composed):
        return failed_task("expansion", composed, reason)
    names = [entry.name for entry in accepted.vast.configuration or [DEFAULT_ENTRY]]
    counts, cuts = composed.counts, composed.breaks
    if len(counts) != len(names) or sum(counts) > limit or not is_breaks(cuts, sum(counts)):
        message = (
            f"The expansion Job reports {sum(counts):,} configurations in {len(counts)} entries, "
            f"but the .vast file has {len(names)} entries and at most {limit:,} configurations are "
            "allowed. Check the variation plugins."
        )
        return Rejected("InvalidDocument", message)
    entries = tuple(
        Entry(name=name, variants=number)
        for name, number in zip(names, counts, strict=True)
        if number
    )
    if not entries:
        message = "No configuration is selected. Check spec.select."
        return Rejected("NothingSelected", message)
    found = replace(accepted, entries=entries, breaks=cuts, composed=composed.digest)
    return _planned(found)
