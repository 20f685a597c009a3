"""Open campaigns in object storage for queries, without a download."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from robovast.base.errors import InputError
from robovast.storage.bucket_ownership import find_bucket, is_owned
from robovast_cli.kube.api import connect
from robovast_cli.kube.results import named_results
from robovast_cli.kube.status import campaign_states
from robovast_cli.kube.store import StorePlace, open_store, store_from_environment

if TYPE_CHECKING:
    from robovast.analysis.tables.stored import StoredTables
    from robovast.storage.s3 import ObjectStore

BUCKET_HELP = (
    "Campaign to read in the object storage, without a download: name of the campaign, of its "
    "results folder or of its bucket"
)
Buckets = Annotated[
    list[str] | None, typer.Option("--bucket", metavar="NAME", help=f"{BUCKET_HELP} (repeatable).")
]
Bucket = Annotated[str | None, typer.Option("--bucket", metavar="NAME", help=f"{BUCKET_HELP}.")]
Context = Annotated[
    str | None,
    typer.Option(
        "--context",
        metavar="NAME",
        help="Context of the kubeconfig, with --bucket (default: the current context).",
    ),
]
Namespace = Annotated[
    str | None,
    typer.Option(
        "--namespace",
        metavar="NAME",
        help="Namespace of the campaign, with --bucket (default: the context's namespace).",
    ),
]


@dataclass(frozen=True)
class InBucket:
    """A campaign in a bucket of an S3 server."""

    store: ObjectStore
    bucket: str
    campaign: str
    """Name of the results folder."""
    scratch: Path
    """Temporary folder for copied files."""

    def tables(self) -> StoredTables:
        """Return the tables of the campaign; see `tables_in`."""
        from robovast.analysis.tables.in_bucket import tables_in

        return tables_in(self.store, self.bucket, self.campaign)

    def has(self, folder: str) -> bool:
        """Return whether a folder of the campaign has files."""
        found = self.store.objects(self.bucket, f"{folder}/")
        return next(iter(found), None) is not None

    def fetch(self, key: str) -> Path:
        """Download one file, if it is stored, and return the local folder of the campaign."""
        folder = self.scratch / self.campaign
        item = self.store.find(self.bucket, key)
        if item is not None:
            self.store.get_file(self.bucket, item, folder / key)
        return folder


@contextmanager
def open_campaigns(
    names: Sequence[str], context: str | None, namespace: str | None
) -> Iterator[list[InBucket]]:
    """Yield campaigns by name.

    If the environment names the S3 server and its keys, no cluster is needed.

    Raises:
        InputError: there is no campaign of a name, or several.
        CannotRunError: the extra `cluster` is not installed, or the cluster cannot be reached.
        StorageError: the S3 server cannot be read.
    """
    store = None if context or namespace else store_from_environment()
    with ExitStack() as stack:
        scratch = Path(stack.enter_context(TemporaryDirectory(prefix="robovast-bucket-")))
        if store is not None:
            yield _by_name(store, names, scratch)
        else:
            yield _by_cluster(names, context, namespace, scratch, stack)


def _by_name(store: ObjectStore, names: Sequence[str], scratch: Path) -> list[InBucket]:
    found = []
    for name in names:
        place = find_bucket(store, name)
        if place is None:
            raise InputError(
                f"{store.endpoint} has no bucket of a campaign `{name}`.",
                hint="check the name, and the address of the object storage",
            )
        bucket, owner = place
        campaign = owner.campaign if owner is not None else bucket
        found.append(InBucket(store, bucket, campaign, scratch / bucket))
    return found


def _by_cluster(
    names: Sequence[str],
    context: str | None,
    namespace: str | None,
    scratch: Path,
    stack: ExitStack,
) -> list[InBucket]:
    kube = stack.enter_context(connect(context, namespace))
    known = campaign_states(kube)
    stores: dict[StorePlace, ObjectStore] = {}
    found = []
    for name in names:
        results = named_results(kube, known, name)
        if results.place not in stores:
            stores[results.place] = stack.enter_context(open_store(kube, results.place))
        store = stores[results.place]
        if results.campaign is not None:
            is_owned(store, results.bucket, results.campaign.uid)
        found.append(InBucket(store, results.bucket, results.name, scratch / results.bucket))
    return found
