"""Assets on a real node: a shared volume and an image that runs read, and cannot write."""

from __future__ import annotations

from robovast_testbed import images
from support.campaigns.local import make_campaign
from support.kube.lab import QUICK, Lab, fill_claim

ASSETS = """\
  kubernetes:
    assets:
    - {path: /assets/worlds, claim: worlds}
    - {path: /assets/models, image: IMAGE}
"""

SCRIPT = """\
cat /assets/worlds/hall.txt /assets/models/etc/robovast_compat_version > "$3/read.txt" || exit 1
! touch /assets/worlds/mine 2> "$3/worlds.txt" || exit 1
! touch /assets/models/mine 2> "$3/models.txt"
"""


def test_runs_read_a_shared_volume_and_an_image_and_cannot_write_to_them(lab: Lab) -> None:
    fill_claim(lab, "worlds", "echo a hall > hall.txt")
    lab.cluster.kubectl(
        "label", "namespace", lab.namespace, "pod-security.kubernetes.io/enforce=restricted"
    )
    extra = ASSETS.replace("IMAGE", images.SLIM)
    lab.apply(make_campaign(lab.folder / "read", SCRIPT, extra, QUICK), "read")
    lab.wait("read")
    home = lab.download("read")
    assert set(lab.verdicts(home).values()) == {"passed"}
    (first, *_) = sorted(home.glob("*/0"))
    assert (first / "read.txt").read_text().startswith("a hall\n")
    for name in ("worlds", "models"):
        assert "Read-only file system" in (first / f"{name}.txt").read_text()
