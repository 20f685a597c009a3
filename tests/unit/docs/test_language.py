"""Texts for users avoid the patterns of docs/contributing/style.md, and their sentences are short.

A pattern may occur in an area as often as its budget states. If you remove occurrences, lower the
budget. `pytest -s -k report tests/unit/docs/test_language.py` prints the counts and the longest
sentences of each area.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from support.user_texts import Text, areas

WORDS = 20
"""Most words of a sentence."""


@dataclass(frozen=True)
class Pattern:
    """A regular expression, what to write instead, and how often it may occur in each area."""

    regex: str
    hint: str
    budget: dict[str, int] = field(default_factory=dict)
    capitals: bool = False

    def found(self, area: str) -> list[str]:
        """Return the occurrences in an area, with place and context."""
        regex = re.compile(self.regex, 0 if self.capitals else re.IGNORECASE)
        return [
            f"{place}: {text[max(0, at.start() - 50) : at.end() + 50]}"
            for place, text in spaced(area)
            for at in regex.finditer(text)
        ]


PATTERNS = (  # the budgets are the present counts, most of them of words with another meaning
    Pattern(r"\bwhat(ever)?\b(?![^.?!]*\?)", "a noun: errors, inputs, changes"),
    Pattern(
        r"(?<!\bthere )\b(is|are|was|were) (none|no)\b(?! longer)", "is not a valid …, is missing"
    ),
    Pattern(r"\b(say|says|said|saying)\b", "states, reports, shows, lists, contains"),
    Pattern(r"\b(tell|tells|told|telling)\b", "notify, report, show, observed"),
    Pattern(
        r"\b(make|makes|made|making)\b(?! sure)",
        "create, write, cause, or a precise verb",
        {"pages": 8, "cli": 1, "chart": 1},
    ),
    Pattern(r"\bbeside\b", "next to, in addition to, compared with"),
    Pattern(r"\b(anew|once more)\b", "again"),
    Pattern(r"\b(go|goes|going|went) on\b", "continue, resume"),
    Pattern(r"\bin all(?=\s*($|[,.;:)]))", "in total"),
    Pattern(r"\btoo(?=[,.;:)])", "also"),
    Pattern(r"\bomitted\b", "(default: X)"),
    Pattern(
        r"\b(nobody|somebody|someone|whoever|everybody|anybody|no one)\b",
        "a role, or passive voice",
    ),
    Pattern(
        r"\b(that|those|these) of (?!the following)|\bof which\b",
        "repeat the noun",
        {"pages": 1, "help": 1},
    ),
    Pattern(
        r"\b(now|no longer|formerly|former|since then|used to be|meanwhile|any more)\b",
        "the present",
        {"help": 1, "cli": 1, "crds": 1},
    ),
    Pattern(
        r"\b(sound|undecided)\b|\b(is|are) broken\b", "passing, failing, inconclusive", {"pages": 2}
    ),
    Pattern(
        r"\b(chancy|flaky|mild(er|est)?)\b",
        "seed-dependent, nondeterministic, less extreme",
        {"pages": 2},
    ),
    Pattern(r"\b(t[ao]k(e|es|en|ing) over|took over)\b", "reuse, import, inherit"),
    Pattern(r"\bg[ia]v(e|en|es|ing) up\b", "fail, abort, stop"),
    Pattern(r"\b(works|worked) (on|up)\b(?! (this|all) )|\bat work\b", "process, postprocess, run"),
    Pattern(r"\b(brings?|brought|bringing|fetched)\b", "download, contain, cause"),
    Pattern(r"\b(left|leaves?|leaving) out\b", "skip, exclude, remove"),
    Pattern(
        r"\b(side by side|at a time)\b",
        "in parallel, concurrently",
        {"pages": 6, "crds": 2, "web": 2},
    ),
    Pattern(
        r"\b(last words|harness|holes?|telephone|mend(s|ed)?|traps?|amounts?|rights)\b",
        "see the glossary",
        {"pages": 2},
    ),
    Pattern(
        r"\b(trouble|silent|notices?|noticed)\b",
        "problem, no log output, notification, detect",
        {"pages": 4},
    ),
    Pattern(
        r"\blook(s|ed)? after\b(?! every)|\bcom(e|es|ing) to\b|\bunder way\b",
        "manage, reach, pending",
    ),
    Pattern(
        r"\bstands?\b(?! (for|by)\b)|\bby itself\b|\bin the end\b|\ball the same\b",
        "be, occur, finally",
    ),
    Pattern(r"\brefus(e|es|ed|al|ing)\b", "reject"),
    Pattern(r"\bexecut(e|es|ed|ing)\b", "run", {"pages": 7, "library": 2}),
    Pattern(
        r"\b(the existing tool|plain process(es)?|(run )?contract|resource definitions)\b",
        "see the glossary",
    ),
    Pattern(
        r"\w*(behaviour|colour|licence|neighbour|centre|metre|grey\b|artefact|cancelled|fulfil\b|fulfils"
        r"|labelled|modell|judgement|(minim|optim|recogn|summar|serial|synchron|organ|initial|normal)is(e|ing)"
        r"|analys(e\b|ed|ing))\w*",
        "American spelling",
        {"pages": 1},
    ),
)
SENTENCES = {
    "pages": 104,
    "help": 10,
    "cli": 3,
    "library": 19,
    "operator": 4,
    "tools": 3,
    "chart": 1,
    "crds": 9,
    "web": 3,
}
"""Longer sentences of each area."""


def spaced(area: str) -> Iterator[Text]:
    """Yield the texts of an area with single spaces."""
    return ((place, " ".join(text.split())) for place, text in areas()[area])


def faults(found: list[str], budget: int) -> list[str]:
    """Return what is wrong with the number of findings."""
    if len(found) > budget:
        return [f"{len(found)} instead of at most {budget}", *found]
    if len(found) < budget - max(3, budget // 10):
        return [f"lower the budget {budget} to {len(found)}"]
    return []


@pytest.mark.parametrize("area", areas())
def test_texts_for_users_avoid_patterns(area: str) -> None:
    wrong = [
        f"{pattern.regex} -> {pattern.hint}: {fault}"
        for pattern in PATTERNS
        for fault in faults(pattern.found(area), pattern.budget.get(area, 0))
    ]
    assert wrong == [], "\n".join(wrong)


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of a text: parts of paragraphs, list items, cells and lines of code."""
    block = r"\n\s*\n|\n(?=\s*(?:[-*>#|]|\d+\.) ?)|\|| · |^#+ .*$|^X$|^ *\w+: "
    for part in re.split(block, text, flags=re.MULTILINE):
        for sentence in re.split(r"(?<=[.!?:])[\s*_)\"]+(?=\W*[A-Z])", " ".join(part.split())):
            yield sentence.strip(" -*>#")


def long_sentences(area: str) -> list[str]:
    """Return the sentences of an area with more than WORDS words, the longest first."""
    found = [
        (len(re.findall(r"\w[\w'/.-]*", sentence)), place, sentence)
        for place, text in areas()[area]
        for sentence in sentences(text)
    ]
    return [
        f"{words} words, {place}: {sentence}"
        for words, place, sentence in sorted(found, reverse=True)
        if words > WORDS
    ]


@pytest.mark.parametrize("area", areas())
def test_sentences_are_short(area: str) -> None:
    assert faults(long_sentences(area), SENTENCES.get(area, 0)) == []


def test_report() -> None:
    print("", *areas(), sep="\t")
    for pattern in PATTERNS:
        print(
            *(len(pattern.found(area)) for area in areas()), pattern.hint, pattern.regex, sep="\t"
        )
    for area in areas():
        found = long_sentences(area)
        print(
            f"{area}: {len(found)} sentences with more than {WORDS} words", *found[:5], sep="\n  "
        )
