"""Addresses of vehicles, as they are written: ``udp:127.0.0.1:14550``, ``serial:/dev/ttyACM0``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from deadtime.links.addresses import is_loopback

Kind = Literal["udp", "udpout", "tcp", "serial"]

#: Bits a second of a serial port where none are given.
BAUD = 115200


@dataclass(frozen=True)
class LinkAddress:
    """Where a vehicle is reached.

    Attributes
    ----------
    kind : {"udp", "udpout", "tcp", "serial"}
        ``udp`` waits at this address for the vehicle, which sends first; ``udpout`` sends to it
        first; ``tcp`` connects to it; ``serial`` is a port of this computer.
    host : str
        The device of a serial port.
    port : int
        Bits a second of a serial port.

    Examples
    --------
    >>> LinkAddress.of("tcp:127.0.0.1:5760")
    LinkAddress(kind='tcp', host='127.0.0.1', port=5760)
    >>> LinkAddress.of("udp:14550").loopback
    True
    >>> [str(address) for address in LinkAddress.all_of("udp:14550,serial:/dev/ttyUSB0:57600")]
    ['udp:127.0.0.1:14550', 'serial:/dev/ttyUSB0:57600']
    """

    kind: Kind
    host: str
    port: int

    @classmethod
    def of(cls, text: str) -> LinkAddress:
        """Read an address.

        Raises
        ------
        ValueError
            If it is none; the message shows the form.
        """
        kind, _, place = text.partition(":")
        if kind == "serial" and not place.rpartition(":")[2].isdecimal():
            place += f":{BAUD}"
        host, _, port = place.rpartition(":")
        host = host.removeprefix("[").removesuffix("]")
        host = host or ("" if kind == "serial" else "127.0.0.1")
        most = 10**8 if kind == "serial" else 65535
        known = kind in get_args(Kind) and bool(host)
        if not known or not port.isdecimal() or not 1 <= int(port) <= most:
            raise ValueError(
                f"the address {text!r} has no known form. Give udp:HOST:PORT to wait for a "
                "vehicle, udpout:HOST:PORT to send first, tcp:HOST:PORT to connect, or "
                "serial:DEVICE:BAUD"
            )
        return cls(kind, host, int(port))  # type: ignore[arg-type]

    @classmethod
    def all_of(cls, text: str) -> tuple[LinkAddress, ...]:
        """Read addresses with commas between them.

        Raises
        ------
        ValueError
            If one is none, or given twice.
        """
        found = tuple(cls.of(address) for address in text.split(","))
        if len(set(found)) < len(found):
            raise ValueError(f"the addresses {text!r} contain a link twice: give each link once")
        return found

    @property
    def loopback(self) -> bool:
        """Whether only this computer is at the other end, or what runs on it."""
        return self.kind != "serial" and is_loopback(self.host)

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.kind}:{host}:{self.port}"
