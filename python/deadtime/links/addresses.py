"""Addresses of sockets, compared by what they mean: ``0::1`` and ``::1`` are one host."""

from __future__ import annotations

import ipaddress
import socket
from contextlib import suppress
from typing import Any, TypeAlias

__all__ = ["Address", "canonical", "for_socket", "is_loopback"]

Address: TypeAlias = tuple[str, int]


def canonical(host: str) -> str:
    """The one spelling of a numeric address; a name is left as it is.

    An IPv4 address that a socket of IPv6 tells as ``::ffff:a.b.c.d`` is the IPv4 address, and the
    scope of a link-local address is the number of its interface, where there is such a one.

    Examples
    --------
    >>> canonical("0::1"), canonical("::ffff:127.0.0.1"), canonical("localhost")
    ('::1', '127.0.0.1', 'localhost')
    """
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host
    if isinstance(address, ipaddress.IPv4Address):
        return str(address)
    if address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    plain, _, scope = str(address).partition("%")
    with suppress(OSError):  # no interface of this name: a number, or none here
        scope = str(socket.if_nametoindex(scope))
    return f"{plain}%{scope}" if scope else plain


def for_socket(address: Address, own_host: str) -> tuple[Any, ...]:
    """An address as a socket that is bound to `own_host` needs it to send there."""
    host, port = address
    if ":" not in own_host:
        return address
    if ":" not in host:
        return f"::ffff:{host}", port
    plain, _, scope = host.partition("%")
    # In two parts the system's own call would lose the scope.
    return (plain, port, 0, int(scope)) if scope.isdecimal() else address


def is_loopback(host: str) -> bool:
    """Whether a host is this computer, as an address or by its name."""
    try:
        return ipaddress.ip_address(canonical(host)).is_loopback
    except ValueError:
        return host == "localhost"
