"""Options of an emulated drone: plant, delays, noise, battery, ports."""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import ip_address
from typing import get_args

from deadtime._base.validation import non_negative
from deadtime.links.addresses import canonical, is_loopback
from deadtime.links.ardrone2.emulator.motion import DELAYS, PlantName

LOOPBACK = "127.0.0.1"

#: First port of the vehicle: navdata, commands and control.
PORT_BASE = 5550
#: Largest delays, for which commands and navdata in transit are kept, and largest noise that
#: navdata can represent.
LARGEST = {"delay": 100.0, "jitter": 100.0, "downlink": 20.0, "noise": 10.0}
PORTS_FROM_BASE = {
    "ftp_port": 1,
    "navdata_port": 4,
    "video_port": 5,
    "command_port": 6,
    "control_port": 9,
}


@dataclass(frozen=True)
class EmulatorOptions:
    """Options of an emulated drone, and where it listens.

    Parameters
    ----------
    plant : {"kit", "paper", "real", "thrust"}
        Dynamics from the commanded climb to the height.
    delay : float, optional
        Transport delay of motion commands, s; by default that of the plant.
    jitter : float
        Each motion command takes up to this much longer, uniformly, s; none overtakes another.
    downlink : float
        Delay of navdata, s.
    noise : float
        Standard deviation of the measured height, m; for the measured climb ten times as much,
        in m/s.
    battery : float
        Charge at the start, percent.
    seed : int
        Of noise and jitter.
    host : str
        Address to listen on.
    clients : tuple of str
        Addresses of the accepted hosts; without any, every host that can reach the emulator.
        Required where other machines can reach it: a forged address then cannot make it send
        navdata to other hosts.
    navdata_port, command_port, control_port : int
        0 takes a free one.
    ftp_port, video_port : int, optional
        Ports for file and video connections, which report that there is no data; none by default.
    worst_case : bool
        Do the worst where the behaviour of the vehicle is not known: hold the last motion until the
        link is lost, and take off whenever it is on the ground and the take-off bit is set.
        Otherwise be forgiving: hover 0.25 s after the last motion command, and take off when the
        bit becomes set.

    Raises
    ------
    ValueError
        If a number is outside its range, the plant is unknown, or others can reach it and no
        clients are named.

    Examples
    --------
    >>> EmulatorOptions(plant="paper").transport_delay
    0.36
    >>> EmulatorOptions(plant="kite")
    Traceback (most recent call last):
    ValueError: plant='kite' is none of kit, paper, real, thrust
    """

    plant: PlantName = "kit"
    delay: float | None = None
    jitter: float = 0.0
    downlink: float = 0.0
    noise: float = 0.002
    battery: float = 100.0
    seed: int = 0
    host: str = LOOPBACK
    navdata_port: int = 5554
    command_port: int = 5556
    control_port: int = 5559
    clients: tuple[str, ...] = ()
    ftp_port: int | None = None
    video_port: int | None = None
    worst_case: bool = True

    def __post_init__(self) -> None:
        if self.plant not in DELAYS:
            raise ValueError(f"plant={self.plant!r} is none of {', '.join(get_args(PlantName))}")
        for name, largest in LARGEST.items():
            if getattr(self, name) is None:
                continue
            value = non_negative(name, getattr(self, name))
            if value > largest:
                raise ValueError(f"{name}={value}: give no more than {largest:g}")
            object.__setattr__(self, name, value)
        if not 0.0 <= self.battery <= 100.0:
            raise ValueError(f"battery={self.battery} is outside 0 to 100: give a percentage")
        if self.seed < 0:
            raise ValueError(f"seed={self.seed} is negative: give 0 or more")
        for name in PORTS_FROM_BASE:
            port = getattr(self, name)
            if port is not None and not 0 <= port <= 65535:
                raise ValueError(f"{name}={port} is no port: give 1 to 65535, or 0 for a free one")
        for client in self.clients:
            try:
                ip_address(client)
            except ValueError:
                raise ValueError(f"clients: {client!r} is no IP address") from None
        if not self.only_here and not self.clients:
            raise ValueError(
                f"host={self.host!r} can be reached by others: name the clients that it answers, "
                "by their IP addresses"
            )

    @property
    def transport_delay(self) -> float:
        """Delay of motion commands without jitter, s."""
        return DELAYS[self.plant] if self.delay is None else self.delay

    @property
    def only_here(self) -> bool:
        """Whether only this machine can reach it."""
        return is_loopback(self.host)

    def answers(self, host: str) -> bool:
        """Whether a host is accepted, in any form of its address."""
        return not self.clients or canonical(host) in map(canonical, self.clients)


def ports_from(base: int) -> dict[str, int]:
    """The ports of the vehicle relative to a base; 0 for free ones."""
    return {name: base and base + offset for name, offset in PORTS_FROM_BASE.items()}
