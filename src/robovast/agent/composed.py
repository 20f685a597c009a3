"""The result of the compose Job in the bucket, of which a pod reads only its own part.

```
_transient/variants/list.json    the document, digests of its files, digests of the parts
_transient/variants/000000.json  the first variants, then the next ones
```

The plan has the digest of the list, so that whatever a pod reads is what was composed.

Of a search, whose variants become more, list and parts have their digest as a name: they are
written once, and pods of an earlier plan go on with theirs.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from robovast.agent.bucket import Bucket
from robovast.agent.digests import check, digest, file_digest
from robovast.base.serialization import dump_yaml
from robovast.base.yaml_files import parse_yaml
from robovast.campaign.configurations import configuration_record, variant_of
from robovast.campaign.layout import PARTS, Layout
from robovast.model.expansion import Variant
from robovast.model.naming import CONFIG

LIST = f"{PARTS}list.json"
PART = 50
"""Variants in one object: a pod reads those of its pack, and at most so many others."""


def store_composed(
    bucket: Bucket, document: str, inputs: Mapping[str, str], variants: Sequence[Variant]
) -> str:
    """Store variants, and the list of them last; returns its digest.

    Args:
        bucket: the campaign's.
        document: file name of the document.
        inputs: SHA-256 of the files beside it, by path.
        variants: in order.
    """
    parts = []
    for first in range(0, len(variants), PART):
        part = _json([_item(variant) for variant in variants[first : first + PART]])
        bucket.store.put_bytes(bucket.name, _part(first // PART), part)
        parts.append(digest(part))
    text = _list(document, inputs, len(variants), parts)
    bucket.store.put_bytes(bucket.name, LIST, text)
    return digest(text)


def store_grown(
    bucket: Bucket,
    document: str,
    inputs: Mapping[str, str],
    before: ComposedVariants | None,
    variants: Sequence[Variant],
) -> str:
    """Store further variants of a search, and the list of all of them; returns its digest.

    Args:
        bucket: the campaign's.
        document: file name of the document.
        inputs: SHA-256 of the files beside it, by path.
        before: the variants so far.
        variants: the further ones.
    """
    full, rest = before.parts() if before is not None else ([], [])
    items = [*rest, *(_item(variant) for variant in variants)]
    parts = list(full)
    for first in range(0, len(items), PART):
        parts.append(_store_named(bucket, _json(items[first : first + PART])))
    return _store_named(bucket, _list(document, inputs, len(full) * PART + len(items), parts))


def _store_named(bucket: Bucket, content: bytes) -> str:
    """Store content under its digest, and return that."""
    name = digest(content)
    bucket.store.put_bytes(bucket.name, _named(name), content)
    return name


def _item(variant: Variant) -> dict[str, Any]:
    """A variant; its values are YAML, which has dates and infinity."""
    return {
        "name": variant.name,
        "entry": variant.entry,
        "record": dump_yaml(configuration_record(variant, timings=False)),
        "files": {
            f"{variant.name}/{CONFIG}/{file.name}": file_digest(file.source)
            for file in variant.files
        },
    }


class ComposedVariants(Sequence[Variant]):
    """The variants of a composed campaign, each read when it is needed.

    Args:
        bucket: the campaign's.
        layout: where the variants' files will be.
        planned: SHA-256 of the list of them.
        growing: whether a search has proposed them.

    Raises:
        InputError: what is in the bucket is not what was composed; also later, of each part.
    """

    def __init__(
        self, bucket: Bucket, layout: Layout, planned: str, *, growing: bool = False
    ) -> None:
        self._bucket = bucket
        self._layout = layout
        self._growing = growing
        listed = json.loads(_read(bucket, _named(planned) if growing else LIST, planned))
        self._parts: list[str] = listed["parts"]
        self._count: int = listed["count"]
        self._part = cache(self._read_part)
        self.document: str = listed["document"]
        self.inputs: Mapping[str, str] = listed["inputs"]
        self.files: dict[str, Mapping[str, str]] = {}
        """SHA-256 of the files of the variants read so far, by variant and key."""

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: Any) -> Any:
        item = self._part(index // PART)[index % PART]
        self.files[item["name"]] = item["files"]
        return variant_of(self._layout, parse_yaml(item["record"]))

    def outlines(self) -> list[Variant]:
        """All of them by name and entry alone: there may be very many."""
        parts = map(self._read_part, range(len(self._parts)))
        return [Variant(item["name"], item["entry"], {}) for part in parts for item in part]

    def parts(self) -> tuple[list[str], list[dict[str, Any]]]:
        """Digests of the parts that are full, and what the last one has, if it is not."""
        full = self._count // PART
        return self._parts[:full], [
            item for n in range(full, len(self._parts)) for item in self._part(n)
        ]

    def _read_part(self, number: int) -> list[dict[str, Any]]:
        name = self._parts[number]
        key = _named(name) if self._growing else _part(number)
        items: list[dict[str, Any]] = json.loads(_read(self._bucket, key, name))
        return items


def _read(bucket: Bucket, key: str, planned: str) -> bytes:
    content = bucket.store.read(bucket.name, key)
    check(f"{bucket.name}/{key}", digest(content) if content is not None else None, planned)
    return content or b""


def _part(number: int) -> str:
    return f"{PARTS}{number:06}.json"


def _named(name: str) -> str:
    return f"{PARTS}{name}.json"


def _list(document: str, inputs: Mapping[str, str], count: int, parts: Sequence[str]) -> bytes:
    return _json({"document": document, "inputs": inputs, "count": count, "parts": parts})


def _json(data: object) -> bytes:
    return json.dumps(data, sort_keys=True, separators=(",", ":")).encode()
