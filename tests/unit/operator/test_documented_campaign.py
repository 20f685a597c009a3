"""What the pages show of a Campaign is what the operator takes."""

from __future__ import annotations

from itertools import chain

import yaml
from support.kube.fake_cluster import SETTINGS
from support.pages import code_blocks

from robovast.kubeapi.resources import ConfigurationSpec
from robovast.kubeapi.source_files import inline_files
from robovast_operator.planning.accept import accept
from robovast_operator.planning.campaign import Accepted

PAGES = ("kubectl", "pod-settings", "notifications", "upload-results")


def test_the_documented_campaign_is_accepted_and_has_four_runs() -> None:
    blocks = [code_blocks(f"docs/how-to/{page}.md", "yaml") for page in PAGES]
    shown = [yaml.safe_load(block) for block in chain(*blocks)]
    obj, _source, adding, needing, placed, reading, notifying, sharing = shown
    obj["spec"] |= {**placed["spec"], **notifying["spec"], **sharing["spec"]}
    kubernetes = {**needing["execution"]["kubernetes"], **reading["execution"]["kubernetes"]}
    given = {**needing["execution"], **reading["execution"], "kubernetes": kubernetes}
    obj["spec"]["vast"]["execution"] |= given
    obj["metadata"] |= {
        "namespace": "default",
        "uid": "0123-4567",
        "creationTimestamp": "2026-11-21T07:00:00Z",
    }
    made = accept(obj, inline_files(obj["spec"]), SETTINGS)
    assert isinstance(made, Accepted), made
    assert [(entry.name, entry.variants) for entry in made.entries] == [("greeting", 2)]
    assert made.runs == 2
    assert ConfigurationSpec.model_validate(adding["spec"]).campaign == obj["metadata"]["name"]
    assert [told.kind for told in made.spec.notifications] == ["ntfy", "webhook"]
