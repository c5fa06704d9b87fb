"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    at_read,
    at_write,
    configuration_read,
    configuration_write,
    doubles_read,
    doubles_write,
    loop_packet_read,
    loop_packet_write,
    navdata_full,
    navdata_layouts,
    navdata_read,
    navdata_write,
)

__all__ = [
    "at_read",
    "at_write",
    "configuration_read",
    "configuration_write",
    "doubles_read",
    "doubles_write",
    "loop_packet_read",
    "loop_packet_write",
    "navdata_full",
    "navdata_layouts",
    "navdata_read",
    "navdata_write",
]
