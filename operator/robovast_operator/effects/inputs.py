"""Reads, checks and freezes a campaign's inputs: its spec, its files, its plans."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from robovast.base.errors import InputError
from robovast.base.yaml_files import parse_yaml
from robovast.kubeapi.resources import CampaignSource, CampaignSpec
from robovast.kubeapi.source_files import Files, config_map_files, inline_files
from robovast.model.packs import CampaignPlan, Entry
from robovast_operator.effects.prerequisites import MISSING, Needs
from robovast_operator.kube import paths
from robovast_operator.kube.announce import is_refusal
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.few_at_once import few_at_once
from robovast_operator.kube.objects import Identity, Key, Object
from robovast_operator.kube.store import Store
from robovast_operator.kube.untrusted_fields import mapping, metadata
from robovast_operator.memory import Asked, InputsCache
from robovast_operator.planning.accept import (
    accept,
    same_document,
    source_changed,
)
from robovast_operator.planning.additions import Additions, expand_alone, with_additions
from robovast_operator.planning.campaign import Accepted, Rejected, Revision
from robovast_operator.planning.configurations import is_own, own_configurations
from robovast_operator.planning.revisions import (
    NO_PLAN,
    Planned,
    any_plan,
    as_planned,
    next_revision,
    owners_note,
    read_revisions,
)
from robovast_operator.planning.separate_processes import Apart
from robovast_operator.pods.jobs import campaign_plan, files_config_map, plan_config_map
from robovast_operator.settings import OperatorSettings

LOGGER = logging.getLogger(__name__)

TOO_LARGE = "DocumentTooLarge"
"""Reason of the rejection of a spec whose expansion exceeded its bounds."""
SOURCE_LABEL = "robovast.io/source"
"""Label of ConfigMaps that Campaigns may read; its value is `true`."""
UNWATCHED = MISSING | {"SourceNotFound", "SourceNotAllowed", "SourceChanged"}
"""Reasons of rejections that end without an event: they are checked periodically."""

Begun = tuple[Accepted, CampaignPlan]
"""A campaign that may have results, and the plan that its pods use."""


class NotYetError(Exception):
    """Another process works on an answer; the Campaign is scheduled when it has it."""


class Inputs:
    """Reads and checks the inputs of campaigns, and makes the ConfigMaps that fix them."""

    def __init__(
        self, api: Api, store: Store, settings: OperatorSettings, again: Callable[[Key], None]
    ) -> None:
        """
        Args:
            api: the API server.
            store: the objects in memory.
            settings: of the installation.
            again: schedules a Campaign.
        """
        self._api = api
        self._again = again
        self._store = store
        self._settings = settings
        self._apart = Apart()
        self._needs = Needs(api)

    async def accepted(self, obj: Object, cache: InputsCache) -> Accepted | Rejected:
        """Check the Campaign in this process as far as possible, once for each change of the spec.

        Raises:
            NotYetError: another process checks it; the Campaign is scheduled when that has ended.
        """
        mark = str(obj["metadata"]["generation"])
        if cache.accepted is None or cache.accepted_for != mark:
            accepted = _too_large(obj) or await self._checked(obj, cache)
            if isinstance(accepted, Accepted):
                planned = await self._where(accepted.identity, cache)
                other = source_changed(planned, accepted)
                missing = other or await self._missing(accepted, cache)
                if missing is not None:
                    return missing
                accepted = replace(accepted, planned=planned)
            elif accepted.reason in UNWATCHED:
                return accepted
            cache.accepted, cache.accepted_for = accepted, mark
            source = cache.asked.source if cache.asked is not None else None
            cache.source, cache.asked = None if cache.files_made else source, None
        return cache.accepted

    async def _checked(self, obj: Object, cache: InputsCache) -> Accepted | Rejected:
        """Return the result of another process that checks the Campaign and its files.

        Raises:
            NotYetError: it has not ended.
        """
        source = await self._source(obj)
        if isinstance(source, Rejected):
            return source
        mark = obj["metadata"]["generation"], metadata(source or {}).get("resourceVersion")
        if cache.asked is None or cache.asked.mark != mark:
            if cache.asked is not None:
                cache.asked.answer.cancel()
            who = Identity.of(obj).key
            answer = self._apart.submit(who, accept, obj, _files(obj, source), self._settings)
            answer.add_done_callback(lambda _: self._again(who))
            cache.asked = Asked(mark, source, answer)
        if not cache.asked.answer.done():
            raise NotYetError
        try:
            return cache.asked.answer.result()
        except InputError as error:
            return Rejected(TOO_LARGE, str(error))
        except Exception:
            cache.asked = None  # to be asked for again
            raise

    async def _missing(self, accepted: Accepted, cache: InputsCache) -> Rejected | None:
        """Return the rejection if the document needs a missing object; None if runs are planned."""
        if await self._load_revisions(accepted.identity, cache):
            return None
        return await self._needs.missing(accepted)

    async def begun(self, obj: Object, cache: InputsCache) -> Begun | Rejected:
        """Return a Campaign and the plan of its results, also if its inputs are deleted.

        Without a plan its status names the bucket. Others may have written that, so the bucket
        must have this Campaign as its owner.
        """
        accepted = await asyncio.to_thread(accept, obj, None, self._settings)
        if isinstance(accepted, Rejected):
            return accepted
        without = accepted.spec.model_copy(update={"source": CampaignSource()})
        accepted = replace(accepted, spec=without)
        planned = await self._where(accepted.identity, cache)
        if planned is not None:
            return accepted, planned
        plan, status = campaign_plan(accepted, None, ()), obj.get("status") or {}
        return accepted, plan.model_copy(update={"bucket": status.get("bucket") or plan.bucket})

    async def as_planned(
        self, obj: Object, cache: InputsCache
    ) -> tuple[Accepted, Sequence[Revision]] | None:
        """Return A Campaign with the document that was planned; None if no run was planned.

        The runs continue, also if the spec has changed since then.
        """
        revisions = await self._load_revisions(Identity.of(obj), cache)
        if not revisions:
            return None
        spec = {**obj["spec"], "vast": parse_yaml(revisions[0].document)}
        found = await asyncio.to_thread(accept, {**obj, "spec": spec}, None, self._settings)
        return None if isinstance(found, Rejected) else (found, revisions)

    async def _source(self, obj: Object) -> Object | Rejected | None:
        """Return the ConfigMap with the input files: the copy, or the original without a copy."""
        try:
            source = CampaignSpec.model_validate(obj["spec"]).source.config_map
        except ValueError:
            return None  # the check of the spec reports the error
        if source is None:
            return None
        identity = Identity.of(obj)
        copy = await self._config_map(identity.namespace, identity.files)
        found = copy or await self._config_map(identity.namespace, source.name)
        if found is None:
            return Rejected(
                "SourceNotFound",
                f"Namespace {identity.namespace} has no ConfigMap `{source.name}`. Create the "
                "ConfigMap, or change spec.source.configMap.",
            )
        labels = mapping(metadata(found).get("labels"))
        if labels.get(SOURCE_LABEL) == "true" or identity.labels.items() <= labels.items():
            return found
        name = str(metadata(found).get("name"))
        return Rejected(
            "SourceNotAllowed",
            f"ConfigMap `{name}` of spec.source.configMap does not have the label "
            f'{SOURCE_LABEL}: "true", so Campaigns cannot read the ConfigMap. If every user who '
            f"can create Campaigns in namespace {identity.namespace} may read the ConfigMap, run "
            f"`kubectl label configmap {name} {SOURCE_LABEL}=true -n {identity.namespace}`.",
        )

    async def _config_map(self, namespace: str, name: str) -> Object | None:
        try:
            return await self._api.get(f"{paths.config_maps(namespace)}/{name}")
        except ApiError as error:
            if error.code == 404:
                return None
            raise

    async def planned(self, accepted: Accepted, cache: InputsCache) -> Accepted | None:
        """Return the campaign with the result of the compose Job; None without a result."""
        revisions = await self._load_revisions(accepted.identity, cache)
        if not revisions:
            return None
        first = revisions[0]
        entries = first.entries[: len(accepted.vast.configuration or [None])]
        return replace(accepted, entries=entries, composed=first.composed)

    @staticmethod
    def is_as_planned(obj: Object, accepted: Accepted, first: Revision, cache: InputsCache) -> bool:
        """Return whether the document is the planned one; parse each change once."""
        generation = obj["metadata"]["generation"]
        if cache.generation_as_planned != generation:
            if not same_document(first.document, accepted.spec.vast):
                return False
            cache.generation_as_planned = generation
        return True

    async def prepare_composing(self, accepted: Accepted, plan: str) -> None:
        """Create the ConfigMaps that the compose Job mounts."""
        await self._create_plan(accepted, Revision(-1, plan, NO_PLAN), ())

    async def make_files(self, accepted: Accepted, cache: InputsCache) -> bool:
        """Copy the input files into an immutable ConfigMap that pods mount.

        Returns:
            False when another replica was faster: its copy of a ConfigMap may be of another moment.
        """
        identity = accepted.identity
        if cache.files_made:
            return True
        config_map = files_config_map(accepted, cache.source)
        made = config_map is None or bool(
            await self._api.create(paths.config_maps(identity.namespace), config_map)
        )
        cache.files_made, source = True, cache.source
        cache.source = None
        is_copy = source is not None and metadata(source).get("name") == identity.files
        if made or source is None or is_copy:
            return True
        cache.forget()
        return False

    async def make_configurations(self, accepted: Accepted) -> None:
        """Create the Configurations of the document's own entries; nothing waits for them."""
        identity = accepted.identity
        there = self._store.configurations_of(identity.key)
        names = {item["metadata"]["name"] for item in there}
        missing = (
            wanted
            for wanted in own_configurations(accepted)
            if wanted["metadata"]["name"] not in names
        )
        await few_at_once(self._make_configuration(wanted) for wanted in missing)

    async def _make_configuration(self, wanted: Object) -> None:
        path = paths.configurations(wanted["metadata"]["namespace"])
        made = await self._api.create(path, wanted)
        if made is not None:
            self._store.put_configuration(made)

    async def additions(self, obj: Object, accepted: Accepted, cache: InputsCache) -> Additions:
        """Return what the Configurations applied by hand add; computed once for each change."""
        identity = accepted.identity
        added = [
            item
            for item in self._store.configurations_of(identity.key)
            if not is_own(item, identity) and "deletionTimestamp" not in item["metadata"]
        ]
        if not added:
            return Additions()
        each = ((item["metadata"]["uid"], item["metadata"].get("generation")) for item in added)
        revisions = await self._load_revisions(identity, cache)
        mark = (obj["metadata"]["generation"], revisions[-1].number if revisions else -1, *each)
        if cache.additions is None or cache.additions_for != mark:
            _keep_answers(cache)
            planned = Planned.of_revisions(revisions)
            found = await asyncio.to_thread(
                with_additions, obj, accepted, added, cache.expanded, planned
            )
            source = await self._source(obj) if found.unknown else None
            if isinstance(source, Rejected):
                found = found.without_unknown(source.message)
            else:
                self._expand(obj, found.unknown, _files(obj, source), cache)
            whole = not (found.unknown or isinstance(source, Rejected))
            cache.additions, cache.additions_for = found, mark if whole else ()
        return cache.additions

    def _expand(
        self, obj: Object, items: Mapping[str, Object], files: Files | None, cache: InputsCache
    ) -> None:
        """Expand Configurations in other processes; schedule the Campaign after each expansion."""
        key = Identity.of(obj).key
        for mark, future in list(cache.expanding.items()):
            if mark not in items:
                future.cancel()
                del cache.expanding[mark]
        for mark, item in items.items():
            if mark not in cache.expanding:
                who = (*key, item["metadata"]["name"])
                future = self._apart.submit(who, expand_alone, obj, item, files, self._settings)
                future.add_done_callback(lambda _: self._again(key))
                cache.expanding[mark] = future

    async def revisions(
        self, accepted: Accepted, additions: Additions, cache: InputsCache
    ) -> Sequence[Revision]:
        """Return the campaign's plans; create a new plan if more runs are requested."""
        revisions = await self._load_revisions(accepted.identity, cache)
        name = accepted.identity.child(f"plan-{revisions[-1].number + 1 if revisions else 0}")
        new = next_revision(accepted, revisions, additions.found, name)
        if new is None:
            return revisions
        await self.append(accepted, new, cache)
        return await self.revisions(accepted, additions, cache)

    async def append(self, accepted: Accepted, new: Revision, cache: InputsCache) -> None:
        """Create a further plan, unless another replica was faster."""
        revisions = await self._load_revisions(accepted.identity, cache)
        if await self._create_plan(as_planned(accepted, new), new, new.entries):
            revisions.append(new)
        else:
            await self._read_theirs(accepted.identity, new.number, new.config_map, cache)

    async def remove_plan(self, identity: Identity, name: str, cache: InputsCache) -> None:
        """Delete a plan that is no longer read; an older chart does not grant this permission."""
        path = f"{paths.config_maps(identity.namespace)}/{name}"
        try:
            await self._api.delete(path, after_children=False)
        except ApiError as error:
            if not is_refusal(error):
                raise
            LOGGER.warning("%s: the old plan cannot be removed: %s", path, error)
        if cache.revisions is not None:
            cache.revisions = [r for r in cache.revisions if r.config_map != name]

    async def _read_theirs(
        self, identity: Identity, number: int, name: str, cache: InputsCache
    ) -> None:
        """Read the plan that another, faster replica created.

        Raises:
            InputError: there is none: another object has the plan's name.
        """
        cache.forget()
        found = await self._load_revisions(identity, cache)
        if not found or found[-1].number < number:
            raise InputError(
                f"ConfigMap {name} exists but does not belong to this campaign",
                hint=f"remove the ConfigMap with `kubectl delete configmap {name} -n "
                f"{identity.namespace}`",
            )

    async def withdrawn(
        self, accepted: Accepted, revisions: Sequence[Revision], cache: InputsCache
    ) -> frozenset[str]:
        """Return the deleted Configurations that had asked for runs, by uid."""
        identity = accepted.identity
        there = self._store.configurations_of(identity.key)
        counted = {item["metadata"]["uid"] for item in there} | cache.withdrawn
        for owner in revisions[-1].owners.values():
            if owner["uid"] not in counted and await self._is_gone(identity.namespace, owner):
                cache.withdrawn.add(owner["uid"])
        return frozenset(cache.withdrawn)

    async def _is_gone(self, namespace: str, owner: Object) -> bool:
        """Ask the server whether an object is really gone: a watch may be late."""
        name = f"metadata.name={owner['name']}"
        found = self._api.list(paths.configurations(namespace), fieldSelector=name)
        return owner["uid"] not in [item["metadata"]["uid"] async for item in found]

    async def _load_revisions(self, identity: Identity, cache: InputsCache) -> list[Revision]:
        """Return the campaign's plans, read once."""
        if cache.revisions is None:
            plans = await self._plans(identity)
            cache.revisions = read_revisions(plans, identity.child("plan-"))
        return cache.revisions

    async def _where(self, identity: Identity, cache: InputsCache) -> CampaignPlan | None:
        """Return any existing plan: all of them name the same place for the results."""
        if cache.planned is None:
            cache.planned = any_plan(await self._plans(identity), identity.child("plan-"))
        return cache.planned

    async def _plans(self, identity: Identity) -> list[Object]:
        """Return the campaign's ConfigMaps."""
        path = paths.config_maps(identity.namespace)
        found = self._api.list(path, labelSelector=identity.selector())
        return [obj async for obj in found]

    async def _create_plan(
        self, accepted: Accepted, revision: Revision, entries: tuple[Entry, ...]
    ) -> bool:
        plan = revision.plan if revision.number >= 0 else None
        content = campaign_plan(accepted, plan, entries)
        obj = plan_config_map(accepted, revision.config_map, content)
        obj["metadata"]["annotations"] = owners_note(revision)
        made = await self._api.create(paths.config_maps(accepted.identity.namespace), obj)
        return made is not None


def _too_large(obj: Object) -> Rejected | None:
    """Return the rejection of an unchanged spec whose expansion exceeded its bounds before."""
    for condition in (obj.get("status") or {}).get("conditions") or ():
        found = condition["type"], condition["reason"], condition.get("observedGeneration")
        if found == ("Accepted", TOO_LARGE, obj["metadata"]["generation"]):
            return Rejected(TOO_LARGE, condition.get("message", ""))
    return None


def _keep_answers(cache: InputsCache) -> None:
    """Keep the expansions that have arrived.

    Raises:
        OSError: one could not begin; it will be asked for again.
    """
    for mark, future in list(cache.expanding.items()):
        if future.done():
            del cache.expanding[mark]
            try:
                cache.expanded[mark] = future.result()
            except InputError as error:
                cache.expanded[mark] = str(error)


def _files(obj: Object, source: Object | None) -> Files | None:
    """Return the input files, as far as the operator can read them.

    Args:
        obj: the Campaign.
        source: the ConfigMap that they stand in, if they stand in one.
    """
    try:
        given = CampaignSpec.model_validate(obj["spec"]).source
        if given.bundle is not None or given.git is not None:
            return None
        if given.config_map is None or source is None:
            return inline_files(obj["spec"])
        return config_map_files(source, {item.key: item.path for item in given.config_map.items})
    except ValueError:
        return {}  # the check of the spec reports the error
