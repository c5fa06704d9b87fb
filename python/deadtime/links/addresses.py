"""Canonical addresses of sockets, so that ``0::1`` and ``::1`` compare as one host."""

from __future__ import annotations

import ipaddress
import socket
from contextlib import suppress
from typing import Any, TypeAlias

Address: TypeAlias = tuple[str, int]


def canonical(host: str) -> str:
    """The canonical form of a numeric address; a name is returned unchanged.

    An IPv4 address that an IPv6 socket reports as ``::ffff:a.b.c.d`` becomes the IPv4 address, and
    the scope of a link-local address the number of its interface, where that exists.

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
    with suppress(OSError):  # the scope is a number, or no interface of this machine
        scope = str(socket.if_nametoindex(scope))
    return f"{plain}%{scope}" if scope else plain


def for_socket(address: Address, own_host: str) -> tuple[Any, ...]:
    """An address in the form for sending from a socket that is bound to `own_host`."""
    host, port = address
    if ":" not in own_host:
        return address
    if ":" not in host:
        return f"::ffff:{host}", port
    plain, _, scope = host.partition("%")
    # A pair (host, port) would lose the scope.
    return (plain, port, 0, int(scope)) if scope.isdecimal() else address


def is_loopback(host: str) -> bool:
    """Whether a host is this computer, as an address or by its name."""
    try:
        return ipaddress.ip_address(canonical(host)).is_loopback
    except ValueError:
        return host == "localhost"
