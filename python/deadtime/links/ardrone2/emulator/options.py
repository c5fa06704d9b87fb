"""Options of an emulated drone: plant, delays, noise, battery, ports."""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import ip_address
from typing import Annotated, get_args

from deadtime._base.bounds import Bounds, check_bounds
from deadtime.links.addresses import canonical, is_loopback
from deadtime.links.ardrone2.emulator.motion import DELAYS, PlantName

LOOPBACK = "127.0.0.1"

#: First port of the vehicle: navdata, commands and control.
PORT_BASE = 5550
#: Delays, s: commands and navdata in transit are kept.
DELAY, DOWNLINK = Bounds(0.0, 100.0), Bounds(0.0, 20.0)
#: Noise that navdata can represent, m.
NOISE = Bounds(0.0, 10.0)
PERCENT, SEED, PORT = Bounds(0.0, 100.0), Bounds(0), Bounds(0, 65535)
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
        Model of the response of the height to the commanded climb.
    delay : float, optional
        Transport delay, s. Default: the plant's.

        That of motion commands, up to 100 s.
    jitter : float
        Largest additional delay of motion commands, s.

        Uniformly distributed, up to 100 s; none overtakes another.
    downlink : float
        Delay of navdata, s.

        Up to 20 s.
    noise : float
        Standard deviation of the noise of the height, m.

        Up to 10 m; the measured climb has ten times as much, in m/s.
    battery : float
        Charge of the battery at the start, percent.

        At the start.
    seed : int
        Seed of noise and jitter.
    host : str
        Address on which the emulator listens. Other computers can reach all addresses except 127.*.
    clients : tuple of str
        Addresses of the accepted hosts; without any, every host that can reach the emulator.
        Required where other machines can reach it: a forged address then cannot make it send
        navdata to other hosts.
    navdata_port, command_port, control_port : int
        Number of this port. With 0, a free port is used.
    ftp_port : int, optional
        Port of an FTP server that has no files. ps_drone needs port 21.

        None by default.
    video_port : int, optional
        Number of this port. With 0, a free port is used.

        It reports that there is no video. None by default.
    worst_case : bool
        Behave as badly as a vehicle may: hold the last motion until the link is lost, and take off
        whenever the bit is set. Or hover 0.25 s after the last motion.

        The bit is that of the take-off. The vehicle that is forgiving takes off when it becomes
        set.

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
    ValueError: plant='kite': give one of kit, paper, real, thrust
    """

    plant: PlantName = "kit"
    delay: Annotated[float | None, DELAY] = None
    jitter: Annotated[float, DELAY] = 0.0
    downlink: Annotated[float, DOWNLINK] = 0.0
    noise: Annotated[float, NOISE] = 0.002
    battery: Annotated[float, PERCENT] = 100.0
    seed: Annotated[int, SEED] = 0
    host: str = LOOPBACK
    navdata_port: Annotated[int, PORT] = 5554
    command_port: Annotated[int, PORT] = 5556
    control_port: Annotated[int, PORT] = 5559
    clients: tuple[str, ...] = ()
    ftp_port: Annotated[int | None, PORT] = None
    video_port: Annotated[int | None, PORT] = None
    worst_case: bool = True

    def __post_init__(self) -> None:
        if self.plant not in DELAYS:
            raise ValueError(f"plant={self.plant!r}: give one of {', '.join(get_args(PlantName))}")
        check_bounds(self)
        for client in self.clients:
            try:
                ip_address(client)
            except ValueError:
                raise ValueError(
                    f"clients contains {client!r}, which is not an IP address"
                ) from None
        if not self.only_here and not self.clients:
            raise ValueError(
                f"other computers can reach host={self.host!r}: give as clients the IP "
                "addresses that the emulator answers"
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
