"""Facts about pods that only Kubernetes knows; the operator passes them to the Job `finish`.

Pods have no access to Kubernetes. Which image a tag stood for on their node, and that their run's
container was killed for lack of memory, is in their status alone.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import takewhile

from pydantic import BaseModel, ConfigDict, ValidationError

FILE = "pods.json"
"""Key of the ConfigMap of one Job's pods."""


class _Data(BaseModel):
    """The serialized form: names of pods without their long common prefix."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    prefix: str = ""
    images: dict[str, list[str]] = {}
    out_of_memory: list[str] = []


@dataclass(frozen=True)
class Sightings:
    """Facts about pods, by their names; nothing is known about other pods."""

    images: Mapping[str, str] = field(default_factory=dict)
    """Digest of the image of a pod's runs."""
    out_of_memory: frozenset[str] = frozenset()
    """Pods whose run's container was killed because it needed more memory than its limit."""

    def __bool__(self) -> bool:
        """Whether anything was seen."""
        return bool(self.images or self.out_of_memory)

    @classmethod
    def together(cls, parts: Iterable[Sightings]) -> Sightings:
        """Merge several into one."""
        images: dict[str, str] = {}
        out_of_memory: set[str] = set()
        for part in parts:
            images |= part.images
            out_of_memory |= part.out_of_memory
        return cls(images, frozenset(out_of_memory))

    def dump(self) -> str:
        """Serialize to text."""
        pods = sorted({*self.images, *self.out_of_memory})
        alike = takewhile(lambda pair: pair[0] == pair[1], zip(pods[0], pods[-1], strict=False))
        prefix = "".join(letter for letter, _ in alike)
        by_image: dict[str, list[str]] = {}
        for pod, image in sorted(self.images.items()):
            by_image.setdefault(image, []).append(pod.removeprefix(prefix))
        killed = [pod.removeprefix(prefix) for pod in sorted(self.out_of_memory)]
        told = _Data(prefix=prefix, images=by_image, out_of_memory=killed)
        return json.dumps(told.model_dump(), separators=(",", ":"))

    @classmethod
    def load(cls, text: str | bytes) -> Sightings:
        """Parse the text; empty if it is invalid."""
        try:
            told = _Data.model_validate_json(text)
        except ValidationError:
            return cls()
        named = (
            (told.prefix + rest, image) for image, pods in told.images.items() for rest in pods
        )
        return cls(dict(named), frozenset(told.prefix + rest for rest in told.out_of_memory))
