"""Describes an archive's content as RO-Crate, a format of data repositories and tools.

Version 1.1 of the format (https://w3id.org/ro/crate/1.1). Equal campaigns give equal bytes.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import quote

from robovast.analysis.publication.context import PublicationCampaign

FILE_NAME = "ro-crate-metadata.json"

_CONTEXT = "https://w3id.org/ro/crate/1.1/context"
_PROFILE = "https://w3id.org/ro/crate/1.1"
_FORMATS = {
    ".csv": "text/csv",
    ".json": "application/json",
    ".parquet": "application/vnd.apache.parquet",
    ".pdf": "application/pdf",
    ".prov.json": "application/ld+json",
    ".vast": "application/yaml",
    ".xml": "application/xml",
    ".yaml": "application/yaml",
}


def ro_crate(
    campaign: PublicationCampaign,
    metadata: Mapping[str, Any],
    execution: Mapping[str, Any],
    paths: Iterable[str],
) -> bytes:
    """The content of `ro-crate-metadata.json`.

    Args:
        campaign: the campaign.
        metadata: `title`, `description`, `license`, `keywords`, `creators` are used.
        execution: content of execution.yaml.
        paths: all files of the archive, relative to the campaign.
    """
    parts = _parts(paths)
    license_ = _license(metadata.get("license"))
    people = [_person(item) for item in _listed(metadata.get("creators"))]
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": str(metadata.get("title") or campaign.name),
        "description": str(
            metadata.get("description") or f"Results of the RoboVAST campaign {campaign.name}."
        ),
        "datePublished": _date(campaign, execution),
        **({"license": {"@id": license_["@id"]}} if license_ else {}),
        **({"author": [{"@id": person["@id"]} for person in people]} if people else {}),
        **_keywords(metadata.get("keywords")),
        "hasPart": [{"@id": part["@id"]} for part in parts],
        "mentions": {"@id": "#execution"},
    }
    descriptor = {
        "@id": FILE_NAME,
        "@type": "CreativeWork",
        "conformsTo": {"@id": _PROFILE},
        "about": {"@id": "./"},
    }
    graph = [descriptor, root, *parts, *people, *([license_] if license_ else [])]
    graph += _execution(campaign.name, execution)
    document = {"@context": _CONTEXT, "@graph": graph}
    return (json.dumps(document, indent=1, ensure_ascii=False) + "\n").encode()


def _parts(paths: Iterable[str]) -> list[dict[str, Any]]:
    """Files and folders at the campaign's top."""
    folders: set[str] = set()
    files: set[str] = set()
    for path in paths:
        top, separator, _ = path.partition("/")
        (folders if separator else files).add(top)
    return [
        *({"@id": quote(name) + "/", "@type": "Dataset", "name": name} for name in sorted(folders)),
        *(_file(name) for name in sorted(files - folders)),
    ]


def _file(name: str) -> dict[str, Any]:
    suffixes = (suffix for suffix in _FORMATS if name.endswith(suffix))
    longest = max(suffixes, key=len, default=None)
    known = {"encodingFormat": _FORMATS[longest]} if longest else {}
    return {"@id": quote(name), "@type": "File", "name": name, **known}


def _execution(campaign: str, execution: Mapping[str, Any]) -> list[dict[str, Any]]:
    version = execution.get("robovast_version")
    start = execution.get("execution_time")
    return [
        {
            "@id": "#execution",
            "@type": "CreateAction",
            "name": f"Execution of the campaign {campaign}",
            **({"startTime": _iso(start)} if start else {}),
            "instrument": {"@id": "#robovast"},
            "result": {"@id": "./"},
        },
        {
            "@id": "#robovast",
            "@type": "SoftwareApplication",
            "name": "RoboVAST",
            **({"softwareVersion": str(version)} if version else {}),
        },
    ]


def _date(campaign: PublicationCampaign, execution: Mapping[str, Any]) -> str:
    """When the results came to be: nothing in an archive depends on when it was packed."""
    if campaign.started:
        return campaign.started.date().isoformat()
    return _iso(execution.get("execution_time") or "1980-01-01")[:10]


def _iso(value: Any) -> str:
    return str(value.isoformat()) if hasattr(value, "isoformat") else str(value)


def _license(value: Any) -> dict[str, str] | None:
    if not value:
        return None
    text = str(value)
    address = text if "://" in text else f"https://spdx.org/licenses/{quote(text)}"
    return {"@id": address, "@type": "CreativeWork", "name": text}


def _person(value: Any) -> dict[str, Any]:
    """A creator, given by name or with the keys `name`, `orcid` and `affiliation`."""
    known = value if isinstance(value, Mapping) else {"name": value}
    name = str(known.get("name", "unknown"))
    orcid = str(known.get("orcid") or "").rpartition("/")[2]
    affiliation = known.get("affiliation")
    return {
        "@id": f"https://orcid.org/{orcid}" if orcid else f"#{quote(name)}",
        "@type": "Person",
        "name": name,
        **({"affiliation": str(affiliation)} if affiliation else {}),
    }


def _keywords(value: Any) -> dict[str, str]:
    words = [str(word) for word in _listed(value)]
    return {"keywords": ", ".join(words)} if words else {}


def _listed(value: Any) -> list[Any]:
    if value is None:
        return []
    return list(value) if isinstance(value, list | tuple) else [value]
