"""The compatibility version that an image and this program must share."""

from __future__ import annotations

from robovast.common.execution import COMPAT_VERSION
from robovast.errors import CannotRunError

VERSION_PATH = "/etc/robovast_compat_version"
"""Where an image says its version."""


def check_compat(image: str, found: str | None) -> None:
    """Refuse an image that speaks another version of the run contract.

    Args:
        image: the image, as the user knows it.
        found: content of its version file; None when it has none.

    Raises:
        CannotRunError: with both numbers, the image and the remedy.
    """
    if (found or "").strip() == str(COMPAT_VERSION):
        return
    says = f"has version `{found.strip()}`" if found else f"has no version ({VERSION_PATH} missing)"
    raise CannotRunError(
        f"the image {image} is not compatible: RoboVAST here needs contract version "
        f"`{COMPAT_VERSION}`, the image {says}. Rebuild the image from "
        "container/robovast/Dockerfile of this RoboVAST (container/build.sh), or use the RoboVAST "
        "that the image was built for."
    )
