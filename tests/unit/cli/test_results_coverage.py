"""`vast results coverage`: what was run, what failed, and a document that runs the holes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from support.campaigns.stored import write, write_run
from support.pages import ROOT

from robovast.model.document import load_document
from robovast.model.expansion import expand
from robovast_cli.main import command

SCENARIO = """\
scenario test:
    speed: float = 1.0
    wind: int = 0
    light: string = "day"
    do serial:
        wait elapsed(1s)
"""
DOCUMENT = """\
version: 1
metadata: {name: hall}
configuration:
- name: hall
  variations:
  - ParameterVariationList: {name: speed, values: [0.5, 1.0, 1.5, 2.0]}
  - ParameterVariationList: {name: wind, values: [0, 5, 10]}
  - ParameterVariationList: {name: light, values: [day, dusk, night]}
  design: {kind: random, count: 6, seed: 1}
execution: {scenario_file: scenario.osc, runs: 4}
"""
DRAWN = DOCUMENT.replace("  design: {kind: random, count: 6, seed: 1}\n", "").replace(
    "  - ParameterVariationList: {name: speed, values: [0.5, 1.0, 1.5, 2.0]}",
    "  - ParameterVariationDistributionUniform: "
    "{name: speed, num_variations: 4, min: 0, max: 2, seed: 1}",
)


def stored(folder: Path, document: str = DOCUMENT) -> Path:
    """A campaign of four runs of each configuration, in which wind of 10 fails at night."""
    config = folder / "hall-2026-03-04-132444" / "_config"
    write(config / "scenario.osc", SCENARIO)
    write(config / "hall.vast", document)
    root = config.parent
    write(root / "_transient" / "configurations.yaml", "vast: hall.vast\nconfigs: []\n")
    write(root / "_execution" / "execution.yaml", "runs: 4\n")
    for place, variant in enumerate(expand(load_document(config / "hall.vast"), folder)):
        bad = variant.parameters["wind"] == 10 and variant.parameters["light"] == "night"
        for number in range(4):
            judge = lambda parameters, number, bad=bad: "failed" if bad else "passed"  # noqa: E731
            index, parameters = 4 * place + number, variant.parameters
            write_run(root, variant.name, number, index, parameters, judge, outputs=False)
    return root


def said(arguments: Sequence[object], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Exit code and all that a command says."""
    with pytest.raises(SystemExit) as ended:
        command().main(args=["results", "coverage", *map(str, arguments)], prog_name="vast")
    output = capsys.readouterr()
    return int(ended.value.code or 0), output.out + output.err


def test_pairs_that_were_run_those_that_failed_and_holes(tmp_path, capsys) -> None:
    code, text = said([stored(tmp_path)], capsys)
    assert code == 0
    assert text.startswith(
        "hall: 6 of 36 combinations; values 9 of 10 (90 %), pairs 15 of 33 (45 %), "
        "triples 6 of 36 (17 %)\n"
    )
    assert "COVERAGE GAP" in text
    assert "… and 8 more (`--worst 0` shows all)" in text


def test_the_page_shows_what_is_printed(tmp_path, capsys) -> None:
    document = DOCUMENT.replace("{kind: random, count: 6, seed: 1}", "{kind: lhs, count: 12}")
    _, text = said([stored(tmp_path, document), "--worst", "3"], capsys)
    assert text in (ROOT / "docs/how-to/combination-designs.md").read_text(encoding="utf-8")


def test_the_worst_pair_comes_first(tmp_path, capsys) -> None:
    document = DOCUMENT.replace("{kind: random, count: 6, seed: 1}", "{kind: full}")
    _, text = said([stored(tmp_path, document)], capsys)
    _, head, first, *_ = text.splitlines()
    assert head.split() == ["PAIR", "UNSUCCESSFUL", "RATE", "95", "%", "INTERVAL"]
    assert first.split()[:5] == ["wind=10,", "light=night", "16", "of", "16"]
    assert "COVERAGE GAP" not in text


def test_the_document_of_the_holes_runs_all_of_them_under_the_names_of_the_product(
    tmp_path, capsys
) -> None:
    root = stored(tmp_path)
    holes = root / "_config" / "holes.vast"
    code, text = said([root, "--holes", holes], capsys)
    assert (code, f"To run: vast -V {holes} exec local run" in text) == (0, True)
    variants = expand(load_document(holes), tmp_path)
    whole = load_document(root / "_config" / "hall.vast")
    full = {v.name: dict(v.parameters) for v in expand_all(whole, tmp_path)}
    assert {v.name: dict(v.parameters) for v in variants}.items() <= full.items()
    for place, variant in enumerate(variants):
        write_run(root, variant.name, 0, 100 + place, variant.parameters, passed, outputs=False)
    code, text = said([root, "--holes", holes], capsys)
    assert "pairs 33 of 33 (100 %)" in text
    assert (code, "every pair of values was run" in text) == (2, True)


def passed(parameters: object, number: int) -> str:
    return "passed"


def expand_all(document, folder):
    """The whole product."""
    text = DOCUMENT.replace("{kind: random, count: 6, seed: 1}", "{kind: full}")
    path = document.folder / "all.vast"
    path.write_text(text)
    return expand(load_document(path), folder)


def test_drawn_values_need_buckets(tmp_path, capsys) -> None:
    root = stored(tmp_path, DRAWN)
    code, text = said([root], capsys)
    assert code == 2
    assert "hall.vast:6:" in text
    assert "`ParameterVariationDistributionUniform` has random continuous values" in text
    assert "--buckets 5" in text
    code, text = said([root, "--buckets", "2"], capsys)
    assert (code, "hall: 18 of 18 combinations" in text) == (0, True)
    code, text = said([root, "--buckets", "40", "--holes", tmp_path / "h.vast"], capsys)
    assert (code, "has random values\nhint: increase their number" in text) == (2, True)


def test_a_campaign_without_variations_has_nothing_to_cover(tmp_path, capsys) -> None:
    root = stored(tmp_path)
    text = DOCUMENT.partition("configuration:")[0] + DOCUMENT.partition("seed: 1}\n")[2]
    (root / "_config" / "hall.vast").write_text(text)
    assert said([root], capsys)[0] == 2
