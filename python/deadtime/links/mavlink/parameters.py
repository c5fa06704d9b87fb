"""Parameters of a vehicle: read, set and read back, and put back at the end."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from deadtime._base.errors import LinkError
from deadtime.links.mavlink.codec import dialect
from deadtime.links.mavlink.connection import ANSWER, Connection

#: Difference of a value that counts as the same: parameters are single precision.
SAME = 1e-6


#: Struct formats of the parameter types of integers.
_INTEGERS = {1: "<Bxxx", 2: "<bxxx", 3: "<Hxx", 4: "<hxx", 5: "<I", 6: "<i"}


def to_bits(value: float, kind: int) -> float:
    """The float with the bits of an integer; another number unchanged."""
    form = _INTEGERS.get(kind)
    if form is None:
        return value
    return float(struct.unpack("<f", struct.pack(form, round(value)))[0])


def from_bits(value: float, kind: int) -> float:
    """The inverse of `to_bits`."""
    form = _INTEGERS.get(kind)
    if form is None:
        return value
    return float(struct.unpack(form, struct.pack("<f", value))[0])


class Parameters:
    """The parameters of one vehicle.

    Parameters
    ----------
    link : Connection
    integers_as_bits : bool
        Whether messages carry the bits of an integer in their float, as PX4 has it.

    Attributes
    ----------
    before : dict
        Values before they were changed, until they are put back.
    """

    def __init__(self, link: Connection, integers_as_bits: bool) -> None:
        self._link, self._bits = link, integers_as_bits
        self.before: dict[str, float] = {}
        self._kinds: dict[str, int] = {}

    async def read(self, name: str) -> float | None:
        """The value of a parameter; None if the vehicle does not answer for it."""
        link, d = self._link, dialect()
        with suppress(LinkError):
            answer = await link.ask(
                lambda attempt: d.MAVLink_param_request_read_message(
                    *link.target, name.encode(), -1
                ),
                lambda message: _is_value(message, name),
                f"answer for its {name}",
            )
            return self._value(answer, name)
        return None

    def _value(self, answer: Any, name: str) -> float:
        self._kinds[name] = int(answer.param_type)
        value, kind = float(answer.param_value), int(answer.param_type)
        return from_bits(value, kind) if self._bits else value

    async def set(self, name: str, value: float) -> None:
        """Set a parameter, and keep the value that it had.

        Raises
        ------
        LinkError
            If the vehicle does not answer for it, or does not say that it has taken the value.
        """
        held = await self.read(name)
        if held is None:
            raise LinkError(f"{self._link.address}: the vehicle does not answer for its {name}")
        if not _same(held, value):
            self.before.setdefault(name, held)
            await self._write(name, value)

    async def _write(self, name: str, value: float) -> None:
        link, d, kind = self._link, dialect(), self._kinds[name]
        sent = to_bits(value, kind) if self._bits else value
        await link.ask(
            lambda attempt: d.MAVLink_param_set_message(*link.target, name.encode(), sent, kind),
            lambda message: _is_value(message, name) and _same(self._value(message, name), value),
            f"keep {name} = {value:g}",
        )

    async def put_back(self, may: Callable[[], bool]) -> str | None:
        """Put the changed parameters back as long as this may be done.

        Returns
        -------
        str or None
            A sentence about those that remain changed.
        """
        for name, value in reversed(list(self.before.items())):  # the fence is off first
            if not may():
                break
            try:
                await self._write(name, value)
                del self.before[name]
            except LinkError:
                if self._link.silent > ANSWER:
                    break  # the others would fail as well, each after seconds
        return self.left

    @property
    def left(self) -> str | None:
        """A sentence about the parameters that are changed in the vehicle; None without any."""
        if not self.before:
            return None
        left = ", ".join(f"{name} = {value:g}" for name, value in self.before.items())
        return f"{self._link.address}: could not be put back in the vehicle: {left}"


def _is_value(message: Any, name: str) -> bool:
    return bool(message.get_type() == "PARAM_VALUE" and message.param_id == name)


def _same(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=SAME, abs_tol=SAME)
