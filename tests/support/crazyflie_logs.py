"""An encoder of logs of a Crazyflie's micro-SD card."""

import struct
import zlib


def definitions(events, version=2):
    """`events` maps an identifier to a name and variables, as ``[("gyro.x", "f"), ...]``."""
    out = b"\xbc" + struct.pack("<HH", version, len(events))
    for number, (name, variables) in events.items():
        out += struct.pack("<H", number) + name.encode() + b"\0" + struct.pack("<H", len(variables))
        out += b"".join(f"{text}({letter})".encode() + b"\0" for text, letter in variables)
    return out


def record(events, number, stamp, values, version=2):
    letters = "".join(letter for _, letter in events[number][1])
    head = struct.pack("<HI" if version == 1 else "<HQ", number, stamp)
    return head + struct.pack(f"<{letters}", *values)


def sealed(log):
    """A log with its checksum."""
    return log + struct.pack("<I", zlib.crc32(log))
