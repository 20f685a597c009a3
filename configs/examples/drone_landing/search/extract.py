"""An extractor: the rate of failures, and means of what the runs measured."""

import csv
from pathlib import Path
from statistics import mean

from robovast.search.extractor import Extractor, ExtractResult, completed_run_dirs
from robovast.search.extractors.failure_rate import failure_rate


class Landing(Extractor):
    """Reads `metrics` of each run."""

    def extract(self, config_dir: Path) -> ExtractResult:
        rows = []
        for run in completed_run_dirs(config_dir):
            with (run / self.params["metrics"]).open(newline="") as file:
                rows.extend(csv.DictReader(file))
        measures = {name: mean(float(row[name]) for row in rows) for name in rows[0]}
        return ExtractResult({"failure_rate": failure_rate(config_dir)}, measures)
