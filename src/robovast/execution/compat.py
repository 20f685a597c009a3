"""Checks that an image and this program have the same version of the run contract."""

from __future__ import annotations

from robovast.base.errors import CannotRunError, with_hint
from robovast.common.execution import COMPAT_VERSION

VERSION_PATH = "/etc/robovast_compat_version"
"""File in an image that contains its version."""

INCOMPATIBLE = 78
"""Exit code of `COMPAT_SCRIPT` for incompatible images."""

REMEDY = (
    "rebuild the image from container/robovast/Dockerfile of this RoboVAST (container/build.sh), "
    "or use the RoboVAST that the image was built for"
)


def check_compat(image: str, found: str | None) -> None:
    """Refuse an image with another version of the run contract.

    Args:
        image: the image's name.
        found: content of its version file; None if it is missing.

    Raises:
        CannotRunError: the image is incompatible; the message has both versions and the remedy.
    """
    if (found or "").strip() == str(COMPAT_VERSION):
        return
    says = f"has version `{found.strip()}`" if found else f"has no version ({VERSION_PATH} missing)"
    raise CannotRunError(
        f"the image {image} is not compatible: RoboVAST here needs image interface version "
        f"`{COMPAT_VERSION}`, the image {says}",
        hint=REMEDY,
    )


_INCOMPATIBLE = with_hint("$says", REMEDY)
COMPAT_SCRIPT = f"""\
found=$(cat {VERSION_PATH} 2>/dev/null)
[ "$found" = "$EXPECTED" ] && exit 0
[ -n "$found" ] && says="has version \\`$found\\`" || says="has no version ({VERSION_PATH} missing)"
echo "the image $IMAGE is not compatible: RoboVAST here needs image interface version \\
\\`$EXPECTED\\`, the image {_INCOMPATIBLE}" | tee /dev/termination-log >&2
exit {INCOMPATIBLE}
"""
"""`check_compat` as a shell script in the image; reads EXPECTED and IMAGE from the environment."""
