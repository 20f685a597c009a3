"""What a campaign is made from: its spec, its files, its plans. Read, checked, and fixed."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import replace

from robovast.base.errors import InputError
from robovast.kubeapi.resources import CampaignSpec, Source
from robovast.model.packs import CampaignPlan, Entry
from robovast_operator.kube import paths
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.few_at_once import few_at_once
from robovast_operator.kube.store import Store
from robovast_operator.memory import Memory
from robovast_operator.planning.accept import Files, accept, config_map_files, inline_files
from robovast_operator.planning.additions import Additions, with_additions
from robovast_operator.planning.apart import Apart
from robovast_operator.planning.campaign import Accepted, Identity, Object, Rejected, Revision
from robovast_operator.planning.configurations import is_own, own_configurations
from robovast_operator.planning.revisions import (
    NO_PLAN,
    any_plan,
    next_revision,
    owners_note,
    read_revisions,
)
from robovast_operator.pods.jobs import campaign_plan, files_config_map, plan_config_map
from robovast_operator.settings import Settings

Begun = tuple[Accepted, CampaignPlan]
"""A campaign that may have results, and what its pods know of it."""


class Inputs:
    """Reads and checks what campaigns are made from, and makes the ConfigMaps that fix it."""

    def __init__(self, api: Api, store: Store, settings: Settings) -> None:
        self._api = api
        self._store = store
        self._settings = settings
        self._apart = Apart()

    async def accepted(self, obj: Object, memory: Memory) -> Accepted | Rejected:
        """The Campaign as far as it can be checked here; once for each change of its spec."""
        mark = str(obj["metadata"]["generation"])
        if memory.accepted is None or memory.accepted_for != mark:
            files = await self._files(obj)
            if isinstance(files, Rejected):
                return files
            try:
                accepted = await self._apart(accept, obj, files, self._settings)
            except InputError as error:
                accepted = Rejected("TooLarge", str(error))
            if isinstance(accepted, Accepted):
                planned = await self._where(accepted.identity, memory)
                accepted = replace(accepted, planned=planned)
            memory.accepted, memory.accepted_for = accepted, mark
        return memory.accepted

    async def begun(self, obj: Object, memory: Memory) -> Begun | Rejected:
        """A Campaign and where its results are, whatever has gone of that which it was made from.

        Its status knows what its plans would say, unless it was never looked at again.
        """
        accepted = await asyncio.to_thread(accept, obj, None, self._settings)
        if isinstance(accepted, Rejected):
            return accepted
        without = accepted.spec.model_copy(update={"source": Source()})
        accepted = replace(accepted, spec=without)
        planned = await self._where(accepted.identity, memory)
        if planned is not None:
            return accepted, planned
        plan, status = campaign_plan(accepted, None, ()), obj.get("status") or {}
        where = {key: status[key] for key in ("bucket", "endpoint") if status.get(key)}
        if where.get("bucket", plan.bucket) != plan.bucket:
            where["owner"] = None  # an older version has named it
        return accepted, plan.model_copy(update=where)

    async def _files(self, obj: Object) -> Files | Rejected | None:
        """The input files, as far as the operator can read them."""
        try:
            source = CampaignSpec.model_validate(obj["spec"]).source
            if source.bundle is not None or source.git is not None:
                return None
            if source.config_map is None:
                return inline_files(obj["spec"])
        except ValueError:
            return {}  # checking the spec says what is wrong
        name, namespace = source.config_map.name, obj["metadata"]["namespace"]
        try:
            data = await self._api.get(f"{paths.config_maps(namespace)}/{name}")
        except ApiError as error:
            if error.code != 404:
                raise
            return Rejected(
                "SourceNotFound",
                f"spec.source.configMap: the namespace {namespace} has no ConfigMap `{name}`",
            )
        return config_map_files(data, {item.key: item.path for item in source.config_map.items})

    async def planned(self, accepted: Accepted, memory: Memory) -> Accepted | None:
        """A campaign with what its compose Job once found out; None when it has not yet."""
        revisions = await self._load_revisions(accepted.identity, memory)
        if not revisions:
            return None
        first = revisions[0]
        entries = first.entries[: len(accepted.vast.configuration or [None])]
        return replace(accepted, entries=entries, composed=first.composed)

    async def prepare_composing(self, accepted: Accepted, plan: str) -> None:
        """What the compose Job mounts."""
        await self._create_plan(accepted, Revision(-1, plan, NO_PLAN), ())

    async def make_files(self, accepted: Accepted, memory: Memory) -> None:
        """The inline files, where pods can mount them."""
        if not memory.files_made:
            config_map = files_config_map(accepted)
            if config_map is not None:
                await self._api.create(paths.config_maps(accepted.identity.namespace), config_map)
            memory.files_made = True

    async def make_configurations(self, accepted: Accepted) -> None:
        """The Configurations of the document's own entries; nothing waits for them."""
        identity = accepted.identity
        there = self._store.configurations_of((identity.namespace, identity.name))
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

    async def additions(self, obj: Object, accepted: Accepted, memory: Memory) -> Additions:
        """What Configurations that were applied by hand add; found out once for each change."""
        identity = accepted.identity
        added = [
            item
            for item in self._store.configurations_of((identity.namespace, identity.name))
            if not is_own(item, identity) and "deletionTimestamp" not in item["metadata"]
        ]
        if not added:
            return Additions()
        each = ((item["metadata"]["uid"], item["metadata"].get("generation")) for item in added)
        mark = (obj["metadata"]["generation"], *each)
        if memory.additions is None or memory.additions_for != mark:
            files = await self._files(obj)
            memory.additions = await asyncio.to_thread(
                with_additions,
                *(obj, accepted, added, files, self._settings, memory.expanded),
                self._apart.call,
            )
            memory.additions_for = () if isinstance(files, Rejected) else mark
        return memory.additions

    async def revisions(
        self, accepted: Accepted, additions: Additions, memory: Memory
    ) -> Sequence[Revision]:
        """The campaign's plans, with one more when more is asked for."""
        memory.problems = dict(additions.problems)
        revisions = await self._load_revisions(accepted.identity, memory)
        name = accepted.identity.child(f"plan-{len(revisions)}")
        new = next_revision(accepted, revisions, additions.found, name)
        if new is not None:
            # The first plan is the document's own: that is compared with it for ever.
            whole = additions.accepted if revisions else None
            told = replace(whole or accepted, planned=accepted.planned)
            if not await self._create_plan(told, new, new.entries):
                memory.forget_inputs()  # another replica was faster: read what it wrote
                return await self.revisions(accepted, additions, memory)
            revisions.append(new)
        return revisions

    async def withdrawn(
        self, accepted: Accepted, revisions: Sequence[Revision], memory: Memory
    ) -> frozenset[str]:
        """The Configurations that asked for runs and are gone, by uid."""
        identity = accepted.identity
        there = self._store.configurations_of((identity.namespace, identity.name))
        known = {item["metadata"]["uid"] for item in there} | memory.withdrawn
        for owner in revisions[-1].owners.values():
            if owner["uid"] not in known and await self._is_gone(identity.namespace, owner):
                memory.withdrawn.add(owner["uid"])
        return frozenset(memory.withdrawn)

    async def _is_gone(self, namespace: str, owner: Object) -> bool:
        """Whether the server does not know an object either: a watch may be late."""
        name = f"metadata.name={owner['name']}"
        found = self._api.list(paths.configurations(namespace), fieldSelector=name)
        return owner["uid"] not in [item["metadata"]["uid"] async for item in found]

    async def _load_revisions(self, identity: Identity, memory: Memory) -> list[Revision]:
        """The campaign's plans, read once."""
        if memory.revisions is None:
            plans = await self._plans(identity)
            memory.revisions = read_revisions(plans, identity.child("plan-"))
        return memory.revisions

    async def _where(self, identity: Identity, memory: Memory) -> CampaignPlan | None:
        """A plan that was fixed: all agree on where the results are."""
        if memory.planned is None:
            memory.planned = any_plan(await self._plans(identity), identity.child("plan-"))
        return memory.planned

    async def _plans(self, identity: Identity) -> list[Object]:
        """The campaign's ConfigMaps."""
        selector = ",".join(f"{name}={value}" for name, value in identity.labels.items())
        found = self._api.list(paths.config_maps(identity.namespace), labelSelector=selector)
        return [obj async for obj in found]

    async def _create_plan(
        self, accepted: Accepted, revision: Revision, entries: tuple[Entry, ...]
    ) -> bool:
        plan = revision.plan if revision.number >= 0 else None
        told = campaign_plan(accepted, plan, entries)
        obj = plan_config_map(accepted, revision.config_map, told)
        obj["metadata"]["annotations"] = owners_note(revision)
        made = await self._api.create(paths.config_maps(accepted.identity.namespace), obj)
        return made is not None
