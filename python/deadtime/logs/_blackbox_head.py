"""The lines of text that open a Blackbox log."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from functools import cached_property

from deadtime._base.errors import RecordingError

#: The first line of each flight in a file.
MARK = b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n"
#: Lines longer than this are no lines of a head.
LONGEST_LINE = 8192

NUMBER = re.compile(r"-?\d{1,18}(\.\d{1,18})?")
#: Lines that hold digits, but no numbers.
TEXTS = {"Craft name", "Data version", "DeviceUID", "Product"}


@dataclass(frozen=True)
class Head:
    """The lines of a head by their names.

    Attributes
    ----------
    lines : dict of str to str
        For example ``{"looptime": "125", ...}``; of a name that repeats, the last.
    size : int
        Bytes of the head.
    """

    lines: dict[str, str]
    size: int

    def text(self, name: str) -> str:
        return self.lines.get(name, "").strip()

    def list(self, name: str) -> list[str]:
        line = self.text(name)
        return line.split(",") if line else []

    def codes(self, name: str) -> bytes:
        """The numbers of a line that defines fields, each below 256."""
        parts = self.list(name)
        if not all(part.isdecimal() and len(part) < 4 and int(part) < 256 for part in parts):
            raise RecordingError(f'the line "{name}" of the header is damaged: {self.text(name)!r}')
        return bytes(map(int, parts))

    @cached_property
    def numbers(self) -> dict[str, float]:
        """Every number; of a line that holds several, as ``"rollPID[0]"``, ``"rollPID[1]"``, …."""
        found = {}
        for name, line in self.lines.items():
            if name in TEXTS or name.startswith(("Field ", "Firmware ")):
                continue
            parts = [part.strip() for part in re.split("[,/]", line)]
            several = len(parts) > 1
            for k, part in enumerate(parts):
                number = _number(part)
                if number is not None:
                    found[f"{name}[{k}]" if several else name] = number
        return found

    def integer(self, name: str, otherwise: int) -> int:
        """A number as an integer of 32 bits."""
        number = self.numbers.get(name, otherwise)
        return int(number) if abs(number) < 2**31 else otherwise


def _number(text: str) -> float | None:
    if NUMBER.fullmatch(text):
        return float(text)
    # The bits of a 32-bit real number, as gyro_scale is written.
    if re.fullmatch("0x[0-9a-fA-F]{1,8}", text):
        (number,) = struct.unpack("<f", int(text, 16).to_bytes(4, "little"))
        return float(number) if number == number and abs(number) < 1e30 else None
    return None


def read_head(log: bytes) -> Head:
    """The head that a log opens with; it ends at the first line that is none of a head."""
    lines = {}
    at = 0
    while log.startswith(b"H ", at):
        end = log.find(b"\n", at, at + LONGEST_LINE)
        colon = log.find(b":", at, end)
        if end < 0 or colon < 0:
            break
        name = log[at + 2 : colon].decode("utf-8", "replace").strip()
        lines[name] = log[colon + 1 : end].decode("utf-8", "replace")
        at = end + 1
    return Head(lines, at)
