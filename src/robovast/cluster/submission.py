"""From a .vast document and the files beside it to a Campaign, as `kubectl apply` takes it."""

from __future__ import annotations

import base64
import gzip
import hashlib
import io
import json
import re
import secrets
import tarfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pydantic import ValidationError

from robovast.cluster.names import CAMPAIGN_NAME_LIMIT
from robovast.cluster.resources import (
    API_VERSION,
    BundleSource,
    CampaignSpec,
    InlineFiles,
    Source,
)
from robovast.document import Document
from robovast.document.model import Resources
from robovast.errors import InputError
from robovast.execution.inputs import campaign_files
from robovast.expansion import Composition
from robovast.expansion.expand import DEFAULT_ENTRY, make_variation

INLINE_LIMIT = 700_000
"""Most characters of a document with its files in one Campaign: etcd takes little more."""
INLINE_FILES = 500
"""Most files in one Campaign."""

_FILE_NAME = r"[A-Za-z0-9][A-Za-z0-9._-]{0,94}\.vast"
_MARK = "bcdfghjklmnpqrstvwxz2456789"
"""Characters of a mark: none that makes a word, none that looks like another."""


@dataclass(frozen=True)
class SubmitOptions:
    """What a user says about a campaign beside its document."""

    select: str | None = None
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
    parallelism: int | None = None
    """Most pods at once."""


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
    """A Campaign, and what must be in S3 before it is created."""

    campaign: dict[str, Any]
    archive: Archive | None = None

    @property
    def name(self) -> str:
        """Name of the Campaign."""
        return str(self.campaign["metadata"]["name"])


def prepare_submission(
    document: Document, options: SubmitOptions, name: str, namespace: str | None = None
) -> Submission:
    """The Campaign that executes a document on a cluster.

    Files that the document needs stand in it when they are small, else in an archive.

    Args:
        document: the checked document.
        options: what counts beside it.
        name: of the Campaign.
        namespace: of the Campaign; left open when None.

    Raises:
        InputError: a variation type cannot say which files it reads, a file cannot be read, or a
            Campaign cannot hold an option's value.
    """
    files = _read(document.folder, input_files(document))
    vast = json.loads(json.dumps(document.source.data, default=str))
    archive = None if _fits(vast, files) else pack(document.folder, files)
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
    """A name for the Campaign of a document, as Kubernetes wants names.

    Args:
        document: the document.
        unique: end it with a random mark, so that the document can be executed again and again.
    """
    words = "".join(c if c.isascii() and c.isalnum() else "-" for c in document.vast.campaign_name)
    name = "-".join(filter(None, words.lower().split("-"))) or "campaign"
    if not unique:
        return name[:CAMPAIGN_NAME_LIMIT].rstrip("-")
    mark = "".join(secrets.choice(_MARK) for _ in range(5))
    return f"{name[: CAMPAIGN_NAME_LIMIT - 6].rstrip('-')}-{mark}"


def input_files(document: Document) -> list[Path]:
    """Files beside the document that its campaign needs, relative to its folder.

    Variation types are asked which files they read; none of them generates anything here.
    """
    root = document.folder.resolve()
    paths = sorted({(root / name).resolve() for name in _files_of_variations(document)})
    below = (path.relative_to(root) for path in paths if path.is_relative_to(root))
    found = campaign_files(document, Composition((), tuple(below)))
    return [path for path in found if path != Path(document.path.name)]


def _files_of_variations(document: Document) -> Iterator[str]:
    with TemporaryDirectory(prefix="robovast-") as folder:
        for entry in document.vast.configuration or [DEFAULT_ENTRY]:
            for call in entry.variations or []:
                try:
                    made = make_variation(document, entry, call, Path(folder), _silent)
                    yield from map(str, made.get_input_files())
                except Exception as error:  # a plugin's code may raise anything
                    raise InputError(
                        f"{document.path}: configuration `{entry.name}`, variation `{call.name}` "
                        f"cannot say which files it reads: {type(error).__name__}: {error}"
                    ) from error


def _silent(message: str) -> None:
    del message


def pack(folder: Path, files: Mapping[str, bytes]) -> Archive:
    """An archive of files, which keep whether they can be executed."""
    buffer = io.BytesIO()
    with (
        gzip.GzipFile(fileobj=buffer, mode="wb", mtime=0) as compressed,
        tarfile.open(fileobj=compressed, mode="w", format=tarfile.PAX_FORMAT) as archive,
    ):
        for name, content in sorted(files.items()):
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            entry.mode = 0o755 if (folder / name).stat().st_mode & 0o100 else 0o644
            archive.addfile(entry, io.BytesIO(content))
    return Archive(buffer.getvalue())


def needs_context(document: Document) -> bool:
    """True when the document has values that are given per cluster."""
    execution = document.vast.execution
    asked = [execution.resources, *(c.resources for c in execution.secondary_containers)]
    return any(_per_cluster(resources) for resources in asked)


def _per_cluster(resources: Resources) -> bool:
    return any(isinstance(value, list) for value in resources.model_dump().values())


def _read(folder: Path, paths: Iterable[Path]) -> dict[str, bytes]:
    try:
        return {path.as_posix(): (folder / path).read_bytes() for path in paths}
    except OSError as error:
        raise InputError(f"{error.filename}: cannot be read: {error.strerror}.") from error


def _fits(vast: Any, files: Mapping[str, bytes]) -> bool:
    size = len(json.dumps(vast)) + sum(_size(content) for content in files.values())
    return size <= INLINE_LIMIT and len(files) <= INLINE_FILES


def _size(content: bytes) -> int:
    return len(content) if _text(content) is not None else len(content) * 4 // 3


def _text(content: bytes) -> str | None:
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return None


def _inline(files: Mapping[str, bytes]) -> Source:
    texts = {name: text for name, content in files.items() if (text := _text(content)) is not None}
    binary = {
        name: base64.b64encode(content).decode("ascii")
        for name, content in files.items()
        if name not in texts
    }
    return Source(inline=InlineFiles(files=texts, binary_files=binary)) if files else Source()


def _bundle(archive: Archive) -> Source:
    return Source(bundle=BundleSource(key=archive.key, sha256=archive.sha256))


def _spec(
    document: Document, vast: dict[str, Any], source: Source, options: SubmitOptions
) -> dict[str, Any]:
    flags = {"-t": options.log_tree, "-d": options.debug}
    given: dict[str, Any] = {
        "image": options.image,
        "cluster": options.context if needs_context(document) else None,
        "select": [options.select] if options.select else None,
        "runs": options.runs,
        "parallelism": options.parallelism,
        "queue_name": options.queue,
        "options": " ".join(flag for flag, on in flags.items() if on),
    }
    try:
        spec = CampaignSpec(
            vast=vast,
            document=document.path.name if re.fullmatch(_FILE_NAME, document.path.name) else None,
            source=source,
            **{key: value for key, value in given.items() if value},
        )
    except ValidationError as error:
        wrong = (f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
        raise InputError(f"no Campaign can be made of it: {'; '.join(wrong)}.") from None
    return spec.model_dump(by_alias=True, exclude_defaults=True, mode="json")
