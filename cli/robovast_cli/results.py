"""`vast results`: from result folders to answers."""

from collections.abc import Mapping

from robovast_cli.lazy import Lazy, new_group

COMMANDS: Mapping[str, Lazy] = {
    "download": Lazy(
        "robovast_cli.results_download:app", "Bring results home from the cluster's storage."
    ),
    "merge-campaigns": Lazy(
        "robovast_cli.results_merge:app",
        "Merge campaigns: runs of equal configurations come together.",
    ),
    "import-results": Lazy(
        "robovast_cli.import_results:app", "Take over a campaign that comes as an archive."
    ),
}

app = new_group("Bring results home, work them up, ask them, publish them.", COMMANDS)
