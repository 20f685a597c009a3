"""The pages of docs/, for tests that hold them to their word."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def code_blocks(page: str, language: str) -> list[str]:
    """The code of a language on a page, by its path in the repository, block by block."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found: list[str] = re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return found


def write_files(page: str, language: str, folder: Path) -> list[str]:
    """Write each block that begins with `# <name>` to the file of that name; returns the names."""
    blocks = {block[2:].partition("\n")[0]: block for block in code_blocks(page, language)}
    for name, block in blocks.items():
        (folder / name).write_text(block, encoding="utf-8")
    return list(blocks)
