"""The network of a testbed, and the way into it from outside."""

import ipaddress
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from . import debian, gobuild
from .bed import Bed
from .commands import run

BRIDGE = "tb0"
NODE_IP = "10.88.0.1"
POD_CIDR = "10.88.0.0/16"
FIRST_POD_IP = "10.88.1.0"
SERVICE_CIDR = "10.96.0.0/16"
API_SERVICE_IP = "10.96.0.1"
DNS_SERVICE_IP = "10.96.0.10"


def create_bridge(bed: Bed) -> None:
    """Make the bridge that is the node's address and the pods' switch; once per testbed."""
    debian.require("ip")
    prefix = ipaddress.ip_network(POD_CIDR).prefixlen
    for command in (
        ("link", "add", BRIDGE, "type", "bridge"),
        ("address", "add", f"{NODE_IP}/{prefix}", "dev", BRIDGE),
        # A bridge has no carrier until one of its ports has.
        ("link", "add", "tb-carrier", "type", "veth", "peer", "name", "tb-port"),
        ("link", "set", "tb-port", "master", BRIDGE),
        ("link", "set", "tb-port", "up"),
        ("link", "set", "tb-carrier", "up"),
        ("link", "set", BRIDGE, "up"),
        ("route", "add", "default", "via", NODE_IP, "dev", BRIDGE),
    ):
        bed.run("ip", *command)
    # From pod to pod by way of a Service's address.
    bed.run("sh", "-c", "echo 1 > /proc/sys/net/ipv4/ip_forward")


def publish(bed: Bed, port: int) -> int:
    """Make a TCP port inside the namespace reachable on the machine's loopback; return its port."""
    with socket.create_server(("127.0.0.1", 0), backlog=128) as listener:
        fd = listener.fileno()
        bed.spawn(
            f"forward-{port}",
            [gobuild.build_own("forward"), f"{fd}=127.0.0.1:{port}"],
            pass_fds=[fd],
        )
        return int(listener.getsockname()[1])


@dataclass(frozen=True)
class Cable:
    """A network between two testbeds, which is otherwise none."""

    address: str
    """Under which the near testbed reaches the far one."""
    near: Bed
    far: Bed
    plug: str
    """Its network interface in both testbeds."""

    @contextmanager
    def pulled(self) -> Iterator[None]:
        """Let it carry nothing for as long as the block runs."""
        self.far.run("ip", "link", "set", self.plug, "down")
        try:
            yield
        finally:
            self.far.run("ip", "link", "set", self.plug, "up")

    def carry_pods(self) -> None:
        """Let pods of the near testbed reach the far one, whose own have the same addresses."""
        debian.require("iptables")
        leaving = ("POSTROUTING", "--out-interface", self.plug, "--jump", "MASQUERADE")
        self.near.run("iptables", "--wait", "--table", "nat", "--append", *leaving)


def connect(near: Bed, far: Bed, number: int) -> Cable:
    """Lay a cable between two testbeds; cables of a testbed have different numbers from 0."""
    plug = f"cable-{number}"
    ends = ("netns", near.netns.name, "type", "veth", "peer", "name", plug)
    run(["ip", "link", "add", plug, *ends, "netns", far.netns.name])
    for host, bed in enumerate((near, far), start=1):
        bed.run("ip", "address", "add", f"10.89.{number}.{host}/24", "dev", plug)
        bed.run("ip", "link", "set", plug, "up")
    return Cable(f"10.89.{number}.2", near, far, plug)
