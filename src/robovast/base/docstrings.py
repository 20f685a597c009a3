"""Whether models know the texts below their fields, which schemas, references and messages show.

Reading them from the source takes a fifth of what a program of ours costs until it starts: the
containers beside runs, of which there are many, do without.
"""

from __future__ import annotations

import os

WITHOUT = "ROBOVAST_WITHOUT_DOCSTRINGS"
"""Environment variable of programs that show none."""

READ = WITHOUT not in os.environ
