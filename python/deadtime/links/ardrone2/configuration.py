"""The settings of the drone as sent on TCP 5559: text lines, and a NUL byte at the end."""

from __future__ import annotations

from collections.abc import Mapping

from deadtime.links._native import configuration_read, configuration_write


def parse_configuration(dump: bytes) -> dict[str, str]:
    r"""Read the settings, keys with their section.

    Raises
    ------
    PacketError
        If the NUL at the end is missing or something follows it, a line is not of the form
        ``section:key = value``, a key has two different values, or it is no text.

    Examples
    --------
    >>> parse_configuration(b"control:control_vz_max = 700\n\0")
    {'control:control_vz_max': '700'}
    """
    return dict(configuration_read(dump))


def write_configuration(settings: Mapping[str, str]) -> bytes:
    r"""Write settings as the drone does.

    Raises
    ------
    ValueError
        If a key is no ``section:key``, or a value would be read differently: it contains control
        characters, or blanks at its ends.

    Examples
    --------
    >>> write_configuration({"control:altitude_max": "3000"})
    b'control:altitude_max = 3000\n\x00'
    """
    return configuration_write(list(settings.items()))
