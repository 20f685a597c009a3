"""What `kubectl get campaigns` shows is in the status, under the names that columns read."""

from __future__ import annotations

import pytest

from robovast.kubeapi.crd import campaign_crd

VERSION = campaign_crd()["spec"]["versions"][0]
COLUMNS = {column["name"]: column for column in VERSION["additionalPrinterColumns"]}


@pytest.mark.parametrize("name", COLUMNS)
def test_a_column_reads_a_key_that_there_is(name: str) -> None:
    path = COLUMNS[name]["jsonPath"].partition("[")[0]
    schema = VERSION["schema"]["openAPIV3Schema"]
    for key in path.strip(".").split("."):
        if key == "metadata":  # Kubernetes' own
            return
        schema = schema["properties"][key]


def test_a_search_shows_its_batches_and_its_best_value() -> None:
    assert COLUMNS["Batches"]["jsonPath"] == ".status.search.batch"
    assert COLUMNS["Best"]["jsonPath"] == ".status.search.best"
