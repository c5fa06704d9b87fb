"""The vehicle that ``deadtime fly`` flies: its options, and how its flights end on a signal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import typer

from deadtime._base.bounds import Bounds
from deadtime._cli.own_emulator import own_emulator
from deadtime.flights import FlownVehicle, MovingDelay
from deadtime.links import Limits, run_landing, terminated_like_interrupted
from deadtime.links.ardrone2.emulator import EmulatorOptions
from deadtime.links.ardrone2.emulator.motion import PlantName
from deadtime.links.mavlink import LinkAddress, MAVLinkVehicle, read_key


@dataclass(frozen=True)
class VehicleOptions:
    """The options that say what is flown.

    Parameters
    ----------
    host : str, optional
        Address of an AR.Drone 2.0. Without --host and --link, an emulator is started.
    link : str, optional
        Link to a vehicle with ArduPilot or PX4. udp:HOST:PORT waits for the vehicle,
        udpout:HOST:PORT sends first, tcp:HOST:PORT connects, and serial:DEVICE:BAUD is a serial
        port. For several links to one vehicle, write commas between the links.
    key : Path, optional
        File with the key that signs the messages of --link, as 32 bytes or 64 hexadecimal digits.
        Messages that are not signed are then ignored.
    consent : bool
        Confirms that a vehicle may take off and fly. Needed with --host, and with a --link to
        another computer or to a vehicle that is not a simulator.
    plant : {"kit", "paper", "real", "thrust"}
        Model of the vehicle in the emulator.
    moving_delay : str, optional
        Two delays of the emulator's commands, s, for --virtual-time. During --adapt the delay goes
        from the first to the second and back.
    seed : int
        Seed of the emulator's noise.
    virtual_time : bool
        Run the emulator and this program in one process, faster than in real time.
    ports : dict of str to int
        Ports of the host.
    """

    host: Annotated[str | None, typer.Option(metavar="ADDRESS")] = None
    link: Annotated[str | None, typer.Option(metavar="KIND:HOST:PORT,…")] = None
    key: Path | None = None
    consent: bool = False
    plant: PlantName = EmulatorOptions.plant
    moving_delay: Annotated[str | None, typer.Option(metavar="FIRST,LONGEST")] = None
    seed: Annotated[int, Bounds(0)] = 0
    virtual_time: bool = False
    ports: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.host is not None and self.link is not None:
            raise ValueError(
                "--host is the address of an AR.Drone, and --link the address of ArduPilot or "
                "PX4: give only one of the two"
            )
        if self.key is not None and self.link is None:
            raise ValueError(
                "--key is the key that signs messages of a link, but no link is given: give --link"
            )

    @property
    def elsewhere(self) -> str | None:
        """Where it is flown, if that is not on this computer alone."""
        if self.link is None or all(address.loopback for address in LinkAddress.all_of(self.link)):
            return self.host
        return self.link

    @property
    def name(self) -> str:
        """The vehicle in words, before it is connected to."""
        if self.elsewhere is not None:
            return f"a drone at {self.elsewhere}"
        return f"an emulator ({self.plant})" if self.link is None else f"the vehicle at {self.link}"

    def check_consent(self) -> None:
        """Refuse a vehicle that is not on this computer alone without consent."""
        if self.elsewhere is not None and not self.consent:
            raise ValueError(
                f"nothing was sent to {self.elsewhere}. A drone at this address would take off "
                "twice and fly as described above. If the flight cannot hurt or damage anything, "
                "add --i-have-a-safe-area"
            )

    def moving(self) -> MovingDelay | None:
        """The delay of the emulator, if it moves."""
        if self.virtual_time and (self.host is not None or self.link is not None):
            raise ValueError(
                "--virtual-time works only with the emulator, because a vehicle flies in real "
                "time: leave out --virtual-time or the address of the vehicle"
            )
        if self.moving_delay is None:
            return None
        if not self.virtual_time:
            raise ValueError(
                "--moving-delay works only with the emulator in virtual time: add --virtual-time"
            )
        try:
            first, longest = (float(part) for part in self.moving_delay.split(","))
        except ValueError:
            raise ValueError(
                f"--moving-delay {self.moving_delay}: give two delays in s, such as 0.1,0.5"
            ) from None
        return MovingDelay((first, longest))

    def restored(self, folder: Path | None) -> list[str]:
        """Put back what earlier runs have left changed over the link; what was done."""
        if self.link is None:
            raise ValueError("--restore needs a vehicle on a link: give its address by --link")
        with terminated_like_interrupted():
            link = MAVLinkVehicle(self.link, key=self._key(), folder=folder)
            return run_landing(link.restore())

    def _key(self) -> bytes | None:
        return None if self.key is None else read_key(self.key)

    @contextmanager
    def flown(
        self, limits: Limits, height: float, moving: MovingDelay | None, folder: Path
    ) -> Iterator[FlownVehicle]:
        """The vehicle; outside virtual time each signal that ends the command lands it first."""
        emulated = FlownVehicle.emulated(self.plant, self.seed, limits, moving)
        if self.virtual_time:
            yield emulated
            return
        with ExitStack() as stack:
            stack.enter_context(terminated_like_interrupted())
            if self.link is not None:
                found = FlownVehicle.over_mavlink(
                    self.link, limits, height, not self.consent, self._key(), folder
                )
            elif self.host is not None:
                found = FlownVehicle.ardrone2(self.host, limits, **self.ports)
            else:
                ports = stack.enter_context(own_emulator(self.plant, self.seed))
                found = FlownVehicle.ardrone2(EmulatorOptions().host, limits, **ports)
                found = replace(found, name=emulated.name)
            yield found
