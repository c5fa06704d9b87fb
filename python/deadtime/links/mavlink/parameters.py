"""Parameters of a vehicle: read, set and read back, and put back at the end."""

from __future__ import annotations

import asyncio
import math
import struct
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from deadtime._base.errors import LinkError
from deadtime.links.mavlink.changed_parameters import Change, ChangedParameters
from deadtime.links.mavlink.codec import dialect
from deadtime.links.mavlink.connection import ANSWER, TRIES, Connection
from deadtime.links.virtual_time import VirtualTimeLoop

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

    Any three messages may be forged, late or sent twice, so that a value counts when four answers
    in a row agree.

    Parameters
    ----------
    link : Connection
    integers_as_bits : bool
        Whether messages carry the bits of an integer in their float, as PX4 has it.
    changed : ChangedParameters
        What is changed in the vehicle until it is put back, and its file.

    Attributes
    ----------
    kept : dict of str to float
        What was set, or found as it has to be.
    """

    def __init__(
        self, link: Connection, integers_as_bits: bool, changed: ChangedParameters
    ) -> None:
        self._link, self._bits, self.changed = link, integers_as_bits, changed
        self.kept: dict[str, float] = {}
        self._planned: dict[str, Change] = {}
        self._kinds: dict[str, int] = {}

    async def read(self, name: str) -> float | None:
        """The value of a parameter; None if the vehicle does not answer for it."""
        message = dialect().MAVLink_param_request_read_message
        target = self._link.target

        def value(answer: Any) -> float | None:
            return self.value_of(answer) if _is_value(answer, name) else None

        return await self._link.agreed(lambda: message(*target, name.encode(), -1), value)

    def value_of(self, answer: Any) -> float:
        """The value in a PARAM_VALUE."""
        value, kind = float(answer.param_value), int(answer.param_type)
        self._kinds[answer.param_id] = kind
        return from_bits(value, kind) if self._bits else value

    async def plan(self, name: str, value: float) -> None:
        """Set a parameter with the next `apply`; until then nothing is set.

        Raises
        ------
        LinkError
            If the vehicle does not answer for it.
        """
        self.kept.pop(name, None)
        held = await self.read(name)
        if held is None:
            raise LinkError(
                f"{self._link.address}: the vehicle does not report its parameter {name}"
            )
        before = self.changed.changes.get(name, Change(held, value)).before
        if same(held, value):
            self.kept[name] = value
        else:
            self._planned[name] = Change(before, value)

    async def apply(self) -> None:
        """Set what was planned, after the values that the vehicle had are on disk.

        Raises
        ------
        LinkError
            If they cannot be written, or the vehicle does not keep a value.
        """
        planned, self._planned = self._planned, {}
        if planned:
            self.changed.changes |= planned
            await self._save()
        for name, change in planned.items():
            await self._write(name, change.set)
            self.kept[name] = change.set

    async def set(self, name: str, value: float) -> None:
        """Set a parameter now; as `plan` and `apply`."""
        await self.plan(name, value)
        await self.apply()

    async def _save(self) -> None:
        """Write the file of the changes; a disk that is slow delays nothing that is in the air."""
        try:
            if isinstance(asyncio.get_running_loop(), VirtualTimeLoop):
                self.changed.save()
            else:
                await asyncio.to_thread(self.changed.save)
        except OSError as error:
            raise LinkError(
                f"{self.changed.path} cannot be written, but the old parameters of the vehicle "
                f"must be kept in this file: {error}"
            ) from error

    async def _write(self, name: str, value: float) -> None:
        link, d, kind = self._link, dialect(), self._kinds[name]
        sent = to_bits(value, kind) if self._bits else value
        for _ in range(TRIES):
            link.send(d.MAVLink_param_set_message(*link.target, name.encode(), sent, kind))
            held = await self.read(name)
            if held is None:
                break
            if same(held, value):
                return
        raise LinkError(f"{link.address}: the vehicle does not accept the value {name} = {value:g}")

    def contradicts(self, message: Any) -> bool:
        """Whether a message says another value of a parameter than was set."""
        if message.get_type() != "PARAM_VALUE" or message.param_id not in self.kept:
            return False
        return not same(self.value_of(message), self.kept[message.param_id])

    async def changed_elsewhere(self, name: str) -> str | None:
        """A clause about a parameter that somebody else has changed; None if it is as set."""
        held, kept = await self.read(name), self.kept.get(name)
        if held is None or kept is None or same(held, kept):
            return None
        return f"{name} was changed from {kept:g} to {held:g}, but not by this link"

    async def put_back(self, may: Callable[[], bool]) -> str | None:
        """Put the changed parameters back as long as this may be done.

        Returns
        -------
        str or None
            A sentence about those that remain changed.
        """
        changes = self.changed.changes
        for name, change in reversed(list(changes.items())):  # the fence is off first
            if not may():
                break
            try:
                self.kept.pop(name, None)
                await self._write(name, change.before)
                del changes[name]
            except LinkError:
                if self._link.silent > ANSWER:
                    break  # the others would fail as well, each after seconds
        with suppress(LinkError):  # the file says more than it has to, then
            await self._save()
        return self.left

    async def restore(self, left: ChangedParameters, may: Callable[[], bool]) -> list[str]:
        """Put back what an earlier run has left; return what somebody has changed since.

        Raises
        ------
        LinkError
            If one cannot be put back.
        """
        since = []
        try:
            for name, change in reversed(list(left.changes.items())):
                held = await self.read(name)
                if held is None or not may():
                    raise LinkError(
                        f"{self._link.address}: the vehicle does not report its parameter "
                        f"{name}, or is not on the ground"
                    )
                if same(held, change.set):
                    await self._write(name, change.before)
                elif not same(held, change.before):
                    since.append(f"{name} = {held:g}")
                del left.changes[name]
            with suppress(OSError):  # the values are those of before, next time as well
                left.save()
        except LinkError as error:
            raise LinkError(
                f"{error}. The parameters that an earlier run changed remain changed. Before, "
                f"the vehicle had {left.words()}: see {left.path}"
            ) from error
        return since

    @property
    def left(self) -> str | None:
        """A sentence about the parameters that are changed in the vehicle; None without any."""
        if not self.changed.changes:
            return None
        return (
            f"{self._link.address}: these parameters could not be restored in the vehicle: "
            f"{self.changed.words()}. Their values are kept in {self.changed.path}. The next "
            f"connection restores them, and so does `deadtime fly --link {self._link.address} "
            "--restore`"
        )


def _is_value(message: Any, name: str) -> bool:
    return bool(message.get_type() == "PARAM_VALUE" and message.param_id == name)


def same(a: float, b: float) -> bool:
    """Whether two values are the same in single precision."""
    return math.isclose(a, b, rel_tol=SAME, abs_tol=SAME)
