"""Built-in commands for whole campaigns."""

from __future__ import annotations

import os
import shlex
import subprocess
import tarfile
from collections.abc import Sequence
from pathlib import Path

from robovast.base.atomic import appearing_file

_LINES_SHOWN = 5
_LONGEST_FIRST_LINE = 256


def command(
    results_dir: str,
    config_dir: str,
    script: str,
    args: Sequence[str] = (),
    provenance_file: str | None = None,
    execution_image: str | None = None,
) -> tuple[bool, str]:
    """Execute `SCRIPT --provenance-file FILE ARGS… RESULTS_DIR` in the results folder.

    Args:
        results_dir: the campaign's folder.
        config_dir: folder of the .vast file, also in $CONFIG_DIR.
        script: path relative to the .vast file, or the name of a program.
        args: its arguments.
        provenance_file: path where the program may write provenance entries.
        execution_image: the campaign's image; passed in $ROBOVAST_IMAGE unless that is set.
    """
    folder, results = os.path.abspath(config_dir), os.path.abspath(results_dir)
    program = _program(folder, script)
    given = ["--provenance-file", provenance_file] if provenance_file else []
    try:
        done = subprocess.run(
            [*program, *given, *map(str, args), results],
            cwd=results,
            env={"ROBOVAST_IMAGE": execution_image or "", **os.environ, "CONFIG_DIR": folder},
            capture_output=True,
            check=False,
        )
    except FileNotFoundError:
        return False, f"there is no program `{script}`, neither in {config_dir} nor on PATH"
    except PermissionError:
        return False, f"{program[0]} is not executable: chmod +x {script}"
    except OSError as error:
        return False, f"{program[0]} cannot be run: {error.strerror}"
    output = (done.stdout + done.stderr).decode(errors="replace")
    print(output, end="")  # noqa: T201  # what a plugin prints goes to the log
    if done.returncode == 0:
        return True, ""
    last = "\n".join(output.strip().splitlines()[-_LINES_SHOWN:])
    return False, f"`{script}` ended with exit code {done.returncode}: {last}"


def _program(folder: str, script: str) -> list[str]:
    """The command line; if a script lost its executable mode, with the interpreter of its `#!`."""
    path = Path(folder) / script
    if not os.path.isfile(path):
        return [script]
    if not os.access(path, os.X_OK):
        with path.open("rb") as file:
            first = file.readline(_LONGEST_FIRST_LINE).decode(errors="replace")
        if first.startswith("#!"):
            return [*shlex.split(first[2:]), str(path)]
    return [str(path)]


def compress(
    results_dir: str,
    config_dir: str,
    output_dir: str | None = None,
    exclude_dirs: Sequence[str] = (".cache",),
    overwrite: bool = False,
) -> tuple[bool, str]:
    """Pack the campaign into the archive `<campaign>.tar.gz`.

    Args:
        results_dir: the campaign's folder.
        config_dir: folder of the .vast file; `output_dir` is relative to it.
        output_dir: folder of the archive; by default the results folder.
        exclude_dirs: names of folders to leave out.
        overwrite: replace an existing archive; otherwise it is kept.
    """
    campaign = Path(results_dir)
    folder = Path(config_dir, output_dir) if output_dir else campaign.parent
    archive = folder / f"{campaign.name}.tar.gz"
    if os.path.exists(archive) and not overwrite:
        return True, f"{archive} is kept as it is; `overwrite: true` replaces it"
    excluded = set(exclude_dirs)

    def wanted(member: tarfile.TarInfo) -> tarfile.TarInfo | None:
        return None if excluded & set(Path(member.name).parts[1:]) else member

    with appearing_file(archive) as part, tarfile.open(part, "w:gz") as file:
        file.add(campaign, campaign.name, filter=wanted)
    return True, f"Wrote {archive}"
