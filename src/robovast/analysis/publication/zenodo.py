"""The publication plugin `zenodo`: uploads archives to a draft, which a person reviews."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from robovast.analysis.publication.context import PublicationCampaign, PublicationContext
from robovast.base.atomic import write_atomically
from robovast.base.environment import environment
from robovast.base.errors import InputError, StorageError
from robovast.base.optional_deps import SHARE
from robovast.base.safe_paths import read_file

if TYPE_CHECKING:
    from robovast.analysis.publication.zenodo_api import Deposit, ZenodoApi

ADDRESS = "ROBOVAST_ZENODO_URL"
TOKEN = "ROBOVAST_ZENODO_TOKEN"  # noqa: S105 - the name of a variable
SANDBOX_TOKEN = "ROBOVAST_ZENODO_SANDBOX_TOKEN"  # noqa: S105 - the name of a variable

RECORD = ".zenodo.json"
"""File in the results folder that records the archives of each draft."""

_SERVER = "https://zenodo.org"
_SANDBOX = "https://sandbox.zenodo.org"


class ZenodoUpload:
    """Uploads archives of previous plugins; publishes only on request."""

    plugin_type: ClassVar[str] = "upload"

    def check(
        self,
        results_dir: str,
        config_dir: str,
        context: PublicationContext,
        metadata: Mapping[str, Any] | None = None,
        sandbox: bool = False,
        **_others: Any,
    ) -> None:
        """Check that a token and a description exist; the server is not contacted.

        Raises:
            RobovastError: one of them, or a package, is missing.
        """
        del results_dir, config_dir
        _api(sandbox=sandbox)
        _metadata(context.campaigns, metadata or {})

    def __call__(
        self,
        results_dir: str,
        config_dir: str,
        metadata: Mapping[str, Any] | None = None,
        sandbox: bool = False,
        publish: bool = False,
        deposition: int | None = None,
        context: PublicationContext | None = None,
    ) -> tuple[bool, str]:
        """Upload archives to a draft on Zenodo; an interrupted upload is resumed.

        Args:
            results_dir: folder of the campaigns; `.zenodo.json` in it records the draft.
            config_dir: not used.
            metadata: fields of the record, named as in Zenodo's API, such as `title`,
                `description`, `creators`, `license`, `keywords`; by default the document's
                `metadata`.
            sandbox: use Zenodo's sandbox, where nothing is permanent.
            publish: also publish the draft, which cannot be undone.
            deposition: number of the draft to use; by default the recorded one or a new one.
            context: the campaigns and their archives.
        """
        del config_dir
        context = context or PublicationContext(())
        files = _files(context)
        described = _metadata(context.campaigns, metadata or {})
        upload = _Upload(_api(sandbox=sandbox), Path(results_dir) / RECORD, files)
        deposit = upload.draft(deposition)
        if not deposit.published:
            upload.fill(deposit, described, context.progress)
        elif upload.missing(deposit):
            raise StorageError(
                f"{deposit.page} is published and cannot be changed; "
                f"{', '.join(path.name for path in upload.missing(deposit))} would be new",
                hint="create a new version there, and set `deposition` to its number",
            )
        if publish and not deposit.published:
            deposit = upload.publish(deposit)
        return True, _summarize(deposit, files)


class _Upload:
    """The upload of archives to one draft."""

    def __init__(self, api: tuple[str, ZenodoApi], record: Path, files: Sequence[Path]) -> None:
        self._address, self._api = api
        self._record = record
        self._files = files

    def draft(self, number: int | None) -> Deposit:
        """The requested draft, the recorded one, or a new one."""
        known = number or self._recorded()
        deposit = self._api.deposit(known) if known else None
        if deposit is None and number:
            raise InputError(
                f"{self._address}: the account has no deposit {number}.",
                hint="correct `deposition`",
            )
        if deposit is None:
            deposit = self._api.make_draft()
            self._remember(deposit.id)
        return deposit

    def missing(self, deposit: Deposit) -> list[Path]:
        """Archives whose content is not in a deposit."""
        from robovast.analysis.publication.zenodo_api import md5_of

        return [path for path in self._files if deposit.files.get(path.name) != md5_of(path)]

    def fill(
        self,
        draft: Deposit,
        metadata: Mapping[str, Any],
        progress: Callable[[str, int, int], None],
    ) -> None:
        """Set a draft's metadata and upload missing archives."""
        self._api.describe(draft, metadata)
        for path in self.missing(draft):
            self._api.upload(draft, path, partial(progress, path.name))

    def publish(self, draft: Deposit) -> Deposit:
        """Publish a complete draft."""
        found = self._api.deposit(draft.id)
        if found is None or self.missing(found):
            raise StorageError(
                f"{draft.page}: lacks some archives, so it was not published", hint="publish again"
            )
        return self._api.publish(draft)

    def _recorded(self) -> int | None:
        number = self._records().get(self._key)
        return number if isinstance(number, int) else None

    def _remember(self, number: int) -> None:
        records = {**self._records(), self._key: number}
        write_atomically(self._record, json.dumps(records, indent=1, sort_keys=True) + "\n")

    def _records(self) -> dict[str, Any]:
        try:
            records = json.loads(read_file(self._record))
        except FileNotFoundError:
            return {}
        except (OSError, ValueError) as error:
            raise StorageError(
                f"{self._record}: cannot be read ({error}). This file lists the existing drafts",
                hint="remove the file to create new drafts",
            ) from error
        return records if isinstance(records, dict) else {}

    @property
    def _key(self) -> str:
        return " ".join([self._address, *sorted(path.name for path in self._files)])


def _api(*, sandbox: bool) -> tuple[str, ZenodoApi]:
    with SHARE.needed_by("Zenodo"):
        from robovast.analysis.publication.zenodo_api import ZenodoApi
    variables = environment()
    address = variables.get(ADDRESS) or (_SANDBOX if sandbox else _SERVER)
    name = SANDBOX_TOKEN if sandbox else TOKEN
    token = variables.get(name)
    if not token:
        raise InputError(
            "Zenodo needs an access token",
            hint="create a token with the scopes `deposit:write` and `deposit:actions` at "
            f"{address}/account/settings/applications, and set the variable {name} in the "
            "environment or a `.env` file",
        )
    return address, ZenodoApi(address, token)


def _files(context: PublicationContext) -> list[Path]:
    if not context.files:
        raise InputError(
            "there is nothing to upload to Zenodo",
            hint="put a plugin that packs, as `zip`, into `results_processing.publication`",
        )
    names = [path.name for path in context.files]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise InputError(
            f"two archives are named {twice}, but Zenodo knows no folders.",
            hint="give them different names with `filename`",
        )
    return list(context.files)


def _metadata(campaigns: Sequence[PublicationCampaign], given: Mapping[str, Any]) -> dict[str, Any]:
    """The record's metadata: the given fields, completed from the document."""
    names = ", ".join(campaign.name for campaign in campaigns)
    document = campaigns[-1].metadata if campaigns else {}
    known = {
        key: document[key]
        for key in ("title", "description", "creators", "license", "keywords")
        if document.get(key)
    }
    metadata = {
        "upload_type": "dataset",
        "title": names,
        "description": f"Results of the RoboVAST campaigns {names}.",
        **known,
        **given,
    }
    creators = metadata.get("creators")
    if not creators or not isinstance(creators, list):
        raise InputError(
            "Zenodo needs `creators`",
            hint="add them to the `metadata` of the document or of the plugin: a list of names "
            "as `Family name, given names`, or of {name, affiliation, orcid}",
        )
    metadata["creators"] = [
        creator if isinstance(creator, Mapping) else {"name": str(creator)} for creator in creators
    ]
    return metadata


def _summarize(deposit: Deposit, files: Sequence[Path]) -> str:
    count = "1 archive" if len(files) == 1 else f"{len(files)} archives"
    if deposit.published:
        return f"{count} published at {deposit.page} (DOI {deposit.doi})"
    return f"{count} in the draft {deposit.page}; not published: review and publish it there"
