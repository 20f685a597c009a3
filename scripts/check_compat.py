#!/usr/bin/env python3
"""Check that the code and every image recipe state the same compatibility version.

Three places must agree: ``COMPAT_VERSION`` in ``src/robovast/common/execution.py``, and in each
``container/*/Dockerfile`` of a run image the ``LABEL`` and the ``RUN echo`` line.

Usage: ``check_compat.py [ROOT]``; exit code 1 when they differ or one is missing.
"""

import re
import sys
from pathlib import Path

CODE = "src/robovast/common/execution.py"
IMAGE_NAMES = ("robovast", "slim")
PATTERNS = {
    "LABEL": re.compile(r'^LABEL robovast\.compat_version="(\d+)"$', re.MULTILINE),
    "RUN echo": re.compile(r'^RUN echo "(\d+)" > /etc/robovast_compat_version$', re.MULTILINE),
}


def stated_versions(root: Path) -> dict[str, str]:
    """Return what each place states, by a name of the place; "missing" where it states nothing."""
    code = re.compile(r"^COMPAT_VERSION\b[^=\n]*=\s*(\d+)", re.MULTILINE)
    found = {f"{CODE} COMPAT_VERSION": _first(code, root / CODE)}
    for name in IMAGE_NAMES:
        recipe = f"container/{name}/Dockerfile"
        for what, pattern in PATTERNS.items():
            found[f"{recipe} {what}"] = _first(pattern, root / recipe)
    return found


def main(root: Path) -> int:
    """Report what every place states; return 0 when all agree, else 1."""
    versions = stated_versions(root)
    sys.stdout.writelines(f"{place}: {version}\n" for place, version in versions.items())
    if "missing" in versions.values() or len(set(versions.values())) > 1:
        sys.stderr.write("error: the compatibility versions above must all be equal\n")
        return 1
    return 0


def _first(pattern: re.Pattern[str], file: Path) -> str:
    match = pattern.search(file.read_text()) if file.is_file() else None
    return match.group(1) if match else "missing"


if __name__ == "__main__":
    default = Path(__file__).resolve().parent.parent
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else default))
