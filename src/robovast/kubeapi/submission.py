"""Builds a Campaign from a .vast document and the files beside it, as `kubectl apply` takes it."""

from __future__ import annotations

import base64
import gzip
import hashlib
import io
import json
import re
import secrets
import tarfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pydantic import ValidationError

from robovast.base.errors import InputError
from robovast.base.file_errors import read_content
from robovast.base.safe_paths import MOST_OF_ALL
from robovast.kubeapi.amounts import check_amounts
from robovast.kubeapi.names import CAMPAIGN_NAME_LIMIT
from robovast.kubeapi.resources import (
    API_VERSION,
    BundleSource,
    CampaignSource,
    CampaignSpec,
    InlineFiles,
)
from robovast.model.document import Document
from robovast.model.document.gpus import check_gpus
from robovast.model.document.problems import sentence
from robovast.model.expansion import Selection, compose, patterns_of, select_any
from robovast.model.expansion.containers import refuse_containers
from robovast.model.expansion.sets import with_all_files
from robovast.model.inputs import campaign_files

INLINE_LIMIT = 700_000
"""Most characters of a document with its files in one Campaign: etcd takes little more."""
INLINE_FILES = 500
"""Most files in one Campaign."""
LONGEST_STEM = 90
"""Most characters of the document's file name, without its ending."""

_MARK = "bcdfghjklmnpqrstvwxz2456789"
"""Characters of a random mark: none that forms words, none that looks like another."""


@dataclass(frozen=True)
class SubmitOptions:
    """The user's options for a campaign, beside its document."""

    select: Selection = None
    """Name or glob of the configurations to run; all when None."""
    runs: int | None = None
    """Runs of each configuration; the document's when None."""
    image: str | None = None
    """Container image; the document's when None."""
    log_tree: bool = False
    """Live behaviour tree of scenario-execution in the logs."""
    debug: bool = False
    """Debug log of scenario-execution."""
    context: str | None = None
    """Name of the cluster in values that the document gives per cluster."""
    queue: str | None = None
    """Kueue LocalQueue."""
    queue_priority: str | None = None
    """Kueue WorkloadPriorityClass."""
    parallelism: int | None = None
    """Most pods at once."""
    reuse: bool = False
    """Take over runs of other campaigns of the storage."""


@dataclass(frozen=True)
class InputFile:
    """A file that is sent to the cluster."""

    content: bytes
    executable: bool = False

    @cached_property
    def text(self) -> str | None:
        """Its text; None when it is not text in UTF-8."""
        try:
            return self.content.decode("utf-8")
        except UnicodeDecodeError:
            return None

    @property
    def inline_size(self) -> int:
        """Its least size in a Campaign [byte]."""
        return len(self.content) if self.text is not None else len(self.content) * 4 // 3

    @property
    def loses_its_mode(self) -> bool:
        """True if it is executable without a `#!`, so that a Campaign loses its mode."""
        return self.executable and not self.content.startswith(b"#!")


@dataclass(frozen=True)
class Archive:
    """A `.tar.gz` of a document's files; equal files make equal bytes."""

    content: bytes

    @property
    def sha256(self) -> str:
        """SHA-256 in hexadecimal digits."""
        return hashlib.sha256(self.content).hexdigest()

    @property
    def key(self) -> str:
        """Its object in the bucket of bundles."""
        return f"{self.sha256}.tar.gz"


@dataclass(frozen=True)
class Submission:
    """A Campaign, and the archive that must be in S3 before it is created."""

    campaign: dict[str, Any]
    archive: Archive | None = None


def prepare_submission(
    document: Document, options: SubmitOptions, name: str, namespace: str | None = None
) -> Submission:
    """The Campaign that executes a document on a cluster.

    Files that the document needs stand in it when they are small, else in an archive.

    Args:
        document: the checked document.
        options: the user's options.
        name: of the Campaign.
        namespace: of the Campaign; left open when None.

    Raises:
        InputError: the document cannot be expanded, or asks for amounts that no pod of this
            cluster can have, nothing matches `options.select`, a file
            cannot be read, or a Campaign cannot hold an option's value.
    """
    _check_amounts(document, options.context)
    files = _input_files(document, options.select)
    vast = json.loads(json.dumps(document.source.data, default=str))
    archive = None if _fits(vast, files) else pack(files)
    source = _bundle(archive) if archive else _inline(files)
    metadata = {"name": name} | ({"namespace": namespace} if namespace else {})
    campaign = {
        "apiVersion": API_VERSION,
        "kind": "Campaign",
        "metadata": metadata,
        "spec": _spec(document, vast, source, options),
    }
    return Submission(campaign, archive)


def campaign_name(document: Document, *, unique: bool) -> str:
    """A valid Kubernetes name for the Campaign of a document.

    Args:
        document: the document.
        unique: append a random mark, so that the document can be executed repeatedly.
    """
    words = "".join(c if c.isascii() and c.isalnum() else "-" for c in document.vast.campaign_name)
    name = "-".join(filter(None, words.lower().split("-"))) or "campaign"
    if not unique:
        return name[:CAMPAIGN_NAME_LIMIT].rstrip("-")
    mark = "".join(secrets.choice(_MARK) for _ in range(5))
    return f"{name[: CAMPAIGN_NAME_LIMIT - 6].rstrip('-')}-{mark}"


def document_name(document: Document) -> str:
    """File name of the document on the cluster.

    Its text goes along: comments and the difference of `1` and `1.0` survive only there.
    """
    stem = re.sub(r"[^A-Za-z0-9._-]+", "-", document.path.stem).strip("-._") or "campaign"
    return f"{stem[:LONGEST_STEM]}.vast"


def pack(files: Mapping[str, InputFile]) -> Archive:
    """An archive of files by path, which keep whether they can be executed."""
    buffer = io.BytesIO()
    with (
        gzip.GzipFile(fileobj=buffer, mode="wb", mtime=0) as compressed,
        tarfile.open(fileobj=compressed, mode="w", format=tarfile.PAX_FORMAT) as archive,
    ):
        for name, file in sorted(files.items()):
            entry = tarfile.TarInfo(name)
            entry.size = len(file.content)
            entry.mode = 0o755 if file.executable else 0o644
            archive.addfile(entry, io.BytesIO(file.content))
    return Archive(buffer.getvalue())


def needs_context(document: Document) -> bool:
    """True when the document has values that are given per cluster."""
    return any(isinstance(value, list) for value in _amounts(document))


def _check_amounts(document: Document, context: str | None) -> None:
    """Refuse what the cluster would refuse later."""
    check_gpus(document)
    if context is None and needs_context(document):
        raise InputError(
            f"{document.source.file}: resources have a value for each cluster, by the context of "
            "the kubeconfig",
            hint="select one with `--context`",
        )
    try:
        check_amounts(document.vast.execution, context or "")
    except InputError as error:
        message = f"{document.source.file}: {error.message}"
        raise InputError(message, hint=error.hint) from None


def _amounts(document: Document) -> Iterator[Any]:
    """The resource amounts of containers."""
    execution = document.vast.execution
    of_pods = {"gpu_resource", "ephemeral_storage"}
    yield from execution.kubernetes.model_dump(include=of_pods).values()
    for resources in (execution.resources, *(c.resources for c in execution.secondary_containers)):
        yield from resources.model_dump().values()


def _input_files(document: Document, select: Selection) -> dict[str, InputFile]:
    """The document and its files; those that variations read are found by expanding."""
    with TemporaryDirectory(prefix="robovast-") as scratch:
        expanded = with_all_files(document)
        composition = compose(expanded, Path(scratch), containers=refuse_containers)
    if document.vast.search is None:
        select_any(composition.variants, select)
    own = Path(document.path.name)
    named = [path for path in campaign_files(document, composition) if path != own]
    paths = {path.as_posix(): document.folder / path for path in named}
    return _read({**paths, document_name(document): document.path})


def _read(paths: Mapping[str, Path]) -> dict[str, InputFile]:
    files = {}
    for name, path in paths.items():
        content = read_content(path, MOST_OF_ALL)
        files[name] = InputFile(content, bool(path.stat().st_mode & 0o100))
    return files


def _fits(vast: Any, files: Mapping[str, InputFile]) -> bool:
    """True when a Campaign can hold the files as they are."""
    size = len(json.dumps(vast)) + sum(file.inline_size for file in files.values())
    modes_survive = not any(file.loses_its_mode for file in files.values())
    return size <= INLINE_LIMIT and len(files) <= INLINE_FILES and modes_survive


def _inline(files: Mapping[str, InputFile]) -> CampaignSource:
    texts = {name: file.text for name, file in files.items() if file.text is not None}
    binary = {
        name: base64.b64encode(file.content).decode("ascii")
        for name, file in files.items()
        if name not in texts
    }
    return CampaignSource(inline=InlineFiles(files=texts, binary_files=binary))


def _bundle(archive: Archive) -> CampaignSource:
    return CampaignSource(bundle=BundleSource(key=archive.key, sha256=archive.sha256))


def _spec(
    document: Document, vast: dict[str, Any], source: CampaignSource, options: SubmitOptions
) -> dict[str, Any]:
    searches = document.vast.search is not None
    flags = {"-t": options.log_tree, "-d": options.debug}
    given: dict[str, Any] = {
        "image": options.image,
        "cluster": options.context if needs_context(document) else None,
        "select": None if searches else patterns_of(options.select) or None,
        "runs": options.runs,
        "parallelism": options.parallelism,
        "queue_name": options.queue,
        "queue_priority_class_name": options.queue_priority,
        "options": " ".join(flag for flag, on in flags.items() if on),
        "reuse": options.reuse,
    }
    try:
        spec = CampaignSpec(
            vast=vast,
            document=document_name(document),
            source=source,
            **{key: value for key, value in given.items() if value},
        )
    except ValidationError as error:
        wrong = (f"{'.'.join(map(str, e['loc']))}: {sentence(e)}" for e in error.errors())
        raise InputError(f"cannot create a Campaign from it: {'; '.join(wrong)}.") from None
    return spec.model_dump(by_alias=True, exclude_defaults=True, mode="json")
