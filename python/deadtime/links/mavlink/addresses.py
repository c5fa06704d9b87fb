"""Addresses of vehicles, as they are written: ``udp:127.0.0.1:14550``, ``tcp:127.0.0.1:5760``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from deadtime.links.addresses import is_loopback

Kind = Literal["udp", "udpout", "tcp"]


@dataclass(frozen=True)
class LinkAddress:
    """Where a vehicle is reached.

    Attributes
    ----------
    kind : {"udp", "udpout", "tcp"}
        ``udp`` waits at this address for the vehicle, which sends first; ``udpout`` sends to it
        first; ``tcp`` connects to it.
    host : str
    port : int

    Examples
    --------
    >>> LinkAddress.of("tcp:127.0.0.1:5760")
    LinkAddress(kind='tcp', host='127.0.0.1', port=5760)
    >>> LinkAddress.of("udp:14550").loopback
    True
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
        host, _, port = place.rpartition(":")
        host = host.removeprefix("[").removesuffix("]") or "127.0.0.1"
        if kind not in get_args(Kind) or not port.isdecimal() or not 1 <= int(port) <= 65535:
            raise ValueError(
                f"the address {text!r}: give udp:HOST:PORT to wait there for a vehicle, "
                "udpout:HOST:PORT to send to one first, or tcp:HOST:PORT to connect to one"
            )
        return cls(kind, host, int(port))  # type: ignore[arg-type]

    @property
    def loopback(self) -> bool:
        """Whether only this computer is at the other end, or what runs on it."""
        return is_loopback(self.host)

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.kind}:{host}:{self.port}"
