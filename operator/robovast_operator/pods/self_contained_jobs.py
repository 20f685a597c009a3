"""Jobs that bring their ConfigMaps with them, for clusters that have none of these.

MultiKueue copies a Job to a worker cluster, and nothing that the Job names. So the content of a
ConfigMap becomes annotations of the Job's pods, and the volume shows these. Of a campaign's files,
which may be binary, they are packed (robovast.kubeapi.pod_contract.packed). Pure functions.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import deepcopy
from functools import partial

from robovast.base.errors import InputError
from robovast.kubeapi.pod_contract.packed import PACKED, pack
from robovast_operator.kube.objects import Object
from robovast_operator.kube.untrusted_fields import mapping, mappings

MOST = 256 * 1024
"""Most that the API server takes as annotations of one object [byte]."""
_ROOM = 4 * 1024
"""What others may add to that, such as Kueue [byte]."""


def config_maps_of(job: Object) -> list[str]:
    """Return names of the ConfigMaps that a Job's pods mount."""
    return list(dict.fromkeys(source["name"] for source in _sources(_volumes(job))))


def carrying(job: Object, config_maps: Mapping[str, Object]) -> Object:
    """Return the Job with the content of its ConfigMaps.

    Args:
        job: the Job.
        config_maps: by name, those that its pods mount.

    Raises:
        InputError: they are too large.
    """
    made = deepcopy(job)
    template = made["spec"]["template"]
    annotations = dict(template["metadata"].get("annotations") or {})
    carry = partial(_carry, config_maps, annotations)
    for volume in template["spec"]["volumes"]:
        if "configMap" in volume:
            volume["downwardAPI"] = {"items": carry(volume.pop("configMap"), _text)}
        for source in mapping(volume.get("projected")).get("sources", ()):
            if "configMap" in source:
                source["downwardAPI"] = {"items": carry(source.pop("configMap"), _packed)}
    size = sum(len(key.encode()) + len(text.encode()) for key, text in annotations.items())
    if size > MOST - _ROOM:
        raise InputError(
            f"The .vast file, the plan and the packed input files have {size} bytes, but a Job "
            f"for another cluster can carry at most {MOST - _ROOM} bytes",
            hint="move files to spec.source.bundle or spec.source.git, or split the .vast file",
        )
    template["metadata"]["annotations"] = annotations
    return made


Item = tuple[str, str]
"""Where a volume shows a text, and the text."""


def _text(config_map: Object, key: str, path: str) -> Item:
    return path, config_map["data"][key]


def _packed(config_map: Object, key: str, path: str) -> Item:
    texts = mapping(config_map.get("data"))
    binary = mapping(config_map.get("binaryData"))
    content = texts[key].encode() if key in texts else base64.b64decode(binary[key])
    return f"{PACKED}/{path}", pack(content)


def _carry(
    config_maps: Mapping[str, Object],
    annotations: dict[str, str],
    source: Object,
    item_of: Callable[[Object, str, str], Item],
) -> list[Object]:
    """Add a ConfigMap's content to annotations; the items of a volume that shows them."""
    found = config_maps[source["name"]]
    keys = [*mapping(found.get("data")), *mapping(found.get("binaryData"))]
    items = []
    for wanted in source.get("items") or [{"key": key, "path": key} for key in keys]:
        if wanted["key"] not in keys:
            raise InputError(
                f"ConfigMap {source['name']} has no key `{wanted['key']}`",
                hint="add the key, or change spec.source.configMap",
            )
        name = f"robovast.io/carried-{len(annotations)}"
        path, annotations[name] = item_of(found, wanted["key"], wanted["path"])
        field = {"fieldPath": f"metadata.annotations['{name}']"}
        items.append({"path": path, "fieldRef": field})
    return items


def _volumes(job: Object) -> list[Object]:
    return list(mappings(job["spec"]["template"]["spec"].get("volumes")))


def _sources(volumes: Iterable[Object]) -> Iterator[Object]:
    """Generate what volumes take from ConfigMaps."""
    for volume in volumes:
        places = [volume, *mapping(volume.get("projected")).get("sources", ())]
        yield from (place["configMap"] for place in places if "configMap" in place)
