"""`vast results report`: a file that can be sent."""

from __future__ import annotations

import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import pytest
from support.campaigns.stored import NAME, add_map, write, write_campaign, write_run

LATER = "hall-2026-03-05-090000"
EVIL = (
    "<script>stolen()</script><img src=x onerror=stolen()> | `@all` [x](http://e.example) "
    "www.e.example \x1b[2J"
)
SHARES = {0.02: 8, 0.1: 1}
GITHUB_TAKES = 65_536


class Elements(HTMLParser):
    """Names and attributes of all elements, and the text outside of styles."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag, attrs) -> None:
        self.found.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        if self.found[-1:] and self.found[-1][0] != "style":
            self.texts.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.texts).split())


def judge(parameters, number: int) -> str:
    return "failed" if number < SHARES[parameters["margin"]] else "passed"


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A campaign whose small margins fail, on a map each, and a later one that has none."""
    monkeypatch.chdir(tmp_path)
    variants = [{"margin": margin, "speed": x} for margin in SHARES for x in range(6)]
    folder, small = tmp_path / "results", {"variants": variants, "runs": 10, "outputs": False}
    root = write_campaign(folder, judge=judge, **small)
    shutil.rmtree(root / "hall-1" / "0")
    write_run(root, "hall-1", 0, 0, variants[0], judge)
    add_map(root, "hall-1")
    write_campaign(folder, LATER, **small)
    return tmp_path / "results"


def report(vast, *options: str) -> Elements:
    assert vast("results", "report", NAME, *options).code == 0
    return Elements(Path("report.html").read_text())


def test_one_file_says_what_failed_where_and_why(vast, results) -> None:
    outcome = vast("results", "report", NAME)
    assert re.fullmatch(rf"report\.html: {NAME} in \d+ kB\n", outcome.out)
    html = Path("report.html").read_text()
    text = Elements(html).text
    assert "✓ 66 passed" in text
    assert "45 % of the runs were unsuccessful (95 % interval 36 – 54 %)" in text
    assert "54 goal not reached: no goal after 20 s failed hall-1/0" in text  # the cause
    assert "margin ≤ 0.02 80 % of 60 10 % of 60" in text  # the factor
    assert "speed ↓ margin → 0.02 0.1 0 80 % 8/10 49 – 94 % 10 % 1/10" in text  # the matrix
    assert "hall-1 goal not reached: no goal after 20 s failing 8 of 10" in text
    assert html.count("<svg") == 1  # one of them has a map
    assert "run 0; blue: planned path; violet: trajectory; red: its last 5 s" in text
    assert "ERROR scenario_execution: <script>window.stolen = true</script> goal" in text
    assert "5.000 s ERROR" in text  # since its start


def test_a_map_without_a_way_says_so(vast, results) -> None:
    for poses in (results / NAME).glob("hall-1/*/poses.csv"):
        poses.unlink()
    text = report(vast).text
    assert "run 0; blue: planned path; no trajectory, because the run has no poses.csv" in text
    assert "violet" not in text


def test_it_runs_nothing_and_loads_nothing(vast, results) -> None:
    root = results / NAME
    write(root / "_config" / "hall.vast", json.dumps({"metadata": dict.fromkeys(
        ("title", "description"), EVIL)}))  # fmt: skip
    for number in range(10):
        file = root / "hall-1" / str(number) / "run.json"
        record = json.loads(file.read_text()) | {"reason": EVIL, "parameters": {EVIL: EVIL}}
        file.write_text(json.dumps(record))
    write(results / LATER / "_config" / f"{EVIL[:8]}.osc", f"{EVIL}\n```\n<!-- \n")
    found = report(vast, "--baseline", LATER, "-o", "report.html", "-o", "report.md")
    names = {tag for tag, _ in found.found}
    assert not names & {"script", "img", "link", "iframe", "object", "base", "form"}
    for _, attributes in found.found:
        assert not [name for name in attributes if name.startswith("on")]
        for name in ("href", "src"):
            assert (attributes.get(name) or "data:").startswith("data:")
    assert found.text.count("<script>stolen()</script>") > 5
    markdown = Path("report.md").read_text()
    outside = re.sub(r"^(`{3,}).*?^\1$", "", markdown, flags=re.MULTILINE | re.DOTALL)
    assert not re.search(r"<(?!/?(code|details|summary)\b)|@all|http://|www\.|\x1b|`", outside)
    assert "\x1b" not in markdown


def test_it_says_what_differs_from_a_baseline(vast, results) -> None:
    write(results / LATER / "_config" / "hall.vast", "version: 1\nconfiguration: []\n")
    text = report(vast, "-b", LATER).text
    assert f"Compared with {LATER}: worse" in text
    assert "from 0 % (0 of 120) to 45 % (54 of 120)" in text
    assert "worse hall-1 0 of 10 8 of 10 +80" in text
    assert "hall.vast changed @@ -1,2 +1 @@ version: 1 -configuration: []" in text
    elsewhere = results.rename("elsewhere") / LATER
    (elsewhere.parent / NAME).rename(NAME)
    assert vast("results", "report", NAME, "-b", elsewhere).code == 0  # in another folder
    assert "hall.vast changed" in Elements(Path("report.html").read_text()).text


def test_a_pull_request_gets_the_same_as_markdown(vast, results) -> None:
    assert vast("results", "report", NAME, "-b", LATER, "-o", "report.md").code == 0
    text = Path("report.md").read_text()
    assert text.startswith(f"## {NAME}\n\n<code>{NAME} · finished · 2026-03-04 13&#58;24 UTC")
    assert f"### Compared with <code>{LATER}</code>: worse" in text
    assert "| 54 | <code>goal not reached&#58; no goal after 20 s</code> | failed |" in text
    assert "| 0 | 80 % (8/10) | 10 % (1/10) |" in text
    assert "ERROR scenario&#95;execution" not in text  # logs are as they are, in blocks
    assert "```\n   0.000 s  INFO  scenario_execution: Executing scenario" in text
    assert not Path("report.html").exists()


def test_whatever_a_campaign_holds_a_report_can_be_sent(vast, results) -> None:
    root = results / NAME
    for file in root.glob("hall-*/*/run.json"):
        number = int(file.parent.name)
        reason = (
            f"{chr(97 + number) * 3} {file.parent.parent.name.replace('-', 'x')} {'y z ' * 999}"
        )
        file.write_text(json.dumps(json.loads(file.read_text()) | {"reason": reason}))
    for log in root.glob("_jobs/*/logs/system.log"):
        log.write_text("".join(f"[ERROR] {'`' * 4000}\n" for _ in range(3000)))
    assert vast("results", "report", NAME, "-o", "a.html", "-o", "a.md", "-b", LATER).code == 0
    assert Path("a.html").stat().st_size < 1_000_000
    assert len(Path("a.md").read_text()) < GITHUB_TAKES


def test_what_cannot_be_read_is_left_out(vast, results) -> None:
    root = results / NAME
    (root / "hall-1" / "_config" / "maps" / "hall.pgm").write_bytes(b"cut off")
    for path in (*root.glob("_jobs/*/logs/system.log"), *root.glob("hall-*/*/poses.csv")):
        path.write_bytes(b"timestamp,position.x\n\xff\0,,\n")
    text = report(vast).text
    assert "66 passed" in text
    assert "its image hall.pgm cannot be read" in text


def test_a_campaign_in_which_all_runs_passed_has_a_short_report(vast, results) -> None:
    assert vast("results", "report", LATER).code == 0
    text = Elements(Path("report.html").read_text()).text
    assert "✓ 120 passed" in text
    assert "Causes of unsuccessful runs" not in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nothing",), "no campaign `nothing`"),
        ((NAME, "-b", "nothing"), "no campaign `nothing`"),
        ((NAME, "-o", "report.pdf"), "report.pdf: a report is HTML or Markdown"),
    ],
)
def test_bad_input_has_one_clear_message(vast, results, arguments, message) -> None:
    outcome = vast("results", "report", *arguments)
    assert (outcome.code, message in outcome.err) == (2, True)
    assert outcome.is_one_error
    assert not list(Path().glob("report.*"))
