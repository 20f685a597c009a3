"""The publication plugin `zenodo`: archives go into a draft, which a person looks at."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from robovast.analysis.publication.context import Campaign, PublicationContext
from robovast.base.atomic import write_atomically
from robovast.base.environment import environment
from robovast.base.errors import CannotRunError, InputError, StorageError

if TYPE_CHECKING:
    from robovast.analysis.publication.zenodo_api import Deposit, ZenodoApi

ADDRESS = "ROBOVAST_ZENODO_URL"
TOKEN = "ROBOVAST_ZENODO_TOKEN"  # noqa: S105 - the name of a variable
SANDBOX_TOKEN = "ROBOVAST_ZENODO_SANDBOX_TOKEN"  # noqa: S105 - the name of a variable

RECORD = ".zenodo.json"
"""File in the results folder that remembers which draft holds which archives."""

_SERVER = "https://zenodo.org"
_SANDBOX = "https://sandbox.zenodo.org"


class ZenodoUpload:
    """Uploads what plugins before have packed; publishes only when it is told to."""

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
        """Look whether there are a token and a description; the server is not asked.

        Raises:
            RobovastError: one is missing, or a package is.
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
        """Upload archives to a draft on Zenodo, resumed where an earlier attempt ended.

        Args:
            results_dir: folder of the campaigns; `.zenodo.json` in it remembers the draft.
            config_dir: not used.
            metadata: fields of the record as Zenodo's API names them, as `title`, `description`,
                `creators`, `license`, `keywords`; the document's `metadata` when omitted.
            sandbox: use Zenodo's sandbox, where nothing is permanent.
            publish: also publish the draft, which can never be undone.
            deposition: number of a draft to use; its own one when omitted.
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
                f"{', '.join(path.name for path in upload.missing(deposit))} would be new. Make a "
                "new version there, and give its number as `deposition`."
            )
        if publish and not deposit.published:
            deposit = upload.publish(deposit)
        return True, _said(deposit, files)


class _Upload:
    """Archives on their way into one draft."""

    def __init__(self, api: tuple[str, ZenodoApi], record: Path, files: Sequence[Path]) -> None:
        self._address, self._api = api
        self._record = record
        self._files = files

    def draft(self, number: int | None) -> Deposit:
        """The draft that is named, or was begun before, or a new one."""
        known = number or self._recorded()
        deposit = self._api.deposit(known) if known else None
        if deposit is None and number:
            raise InputError(f"{self._address}: the account has no deposit {number}.")
        if deposit is None:
            deposit = self._api.make_draft()
            self._remember(deposit.id)
        return deposit

    def missing(self, deposit: Deposit) -> list[Path]:
        """Archives that a deposit does not have as they are here."""
        from robovast.analysis.publication.zenodo_api import md5_of

        return [path for path in self._files if deposit.files.get(path.name) != md5_of(path)]

    def fill(
        self,
        draft: Deposit,
        metadata: Mapping[str, Any],
        progress: Callable[[str, int, int], None],
    ) -> None:
        """Describe a draft and upload what it lacks."""
        self._api.describe(draft, metadata)
        for path in self.missing(draft):
            self._api.upload(draft, path, partial(progress, path.name))

    def publish(self, draft: Deposit) -> Deposit:
        """Publish a draft that has everything."""
        found = self._api.deposit(draft.id)
        if found is None or self.missing(found):
            raise StorageError(
                f"{draft.page}: does not have all archives, so it was not published. Publish again."
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
            records = json.loads(self._record.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return {}
        except (OSError, ValueError) as error:
            raise StorageError(
                f"{self._record}: cannot be read ({error}); it says which drafts were begun. "
                "Remove it to begin new ones."
            ) from error
        return records if isinstance(records, dict) else {}

    @property
    def _key(self) -> str:
        return " ".join([self._address, *sorted(path.name for path in self._files)])


def _api(*, sandbox: bool) -> tuple[str, ZenodoApi]:
    try:
        from robovast.analysis.publication.zenodo_api import ZenodoApi
    except ImportError as error:
        raise CannotRunError(
            f"Zenodo needs the package {error.name}: install `robovast[share]`."
        ) from None
    variables = environment()
    address = variables.get(ADDRESS) or (_SANDBOX if sandbox else _SERVER)
    name = SANDBOX_TOKEN if sandbox else TOKEN
    token = variables.get(name)
    if not token:
        raise InputError(
            f"Zenodo needs an access token in the variable {name}, in the environment or a `.env` "
            f"file. {address}/account/settings/applications makes one; it needs the scopes "
            "`deposit:write` and `deposit:actions`."
        )
    return address, ZenodoApi(address, token)


def _files(context: PublicationContext) -> list[Path]:
    if not context.files:
        raise InputError(
            "there is nothing to upload to Zenodo: put a plugin that packs, as `zip`, into "
            "`results_processing.publication`."
        )
    names = [path.name for path in context.files]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise InputError(f"two archives are named {twice}, but Zenodo knows no folders.")
    return list(context.files)


def _metadata(campaigns: Sequence[Campaign], given: Mapping[str, Any]) -> dict[str, Any]:
    """The record's metadata: what is given, else what the document says."""
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
            "Zenodo needs `creators` in the `metadata` of the document or of the plugin: a list of "
            "names as `Family name, given names`, or of {name, affiliation, orcid}."
        )
    metadata["creators"] = [
        creator if isinstance(creator, Mapping) else {"name": str(creator)} for creator in creators
    ]
    return metadata


def _said(deposit: Deposit, files: Sequence[Path]) -> str:
    count = "1 archive" if len(files) == 1 else f"{len(files)} archives"
    if deposit.published:
        return f"{count} published at {deposit.page} (DOI {deposit.doi})"
    return f"{count} in the draft {deposit.page}; it is not published, look at it and do it there"
