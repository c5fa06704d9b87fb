"""The controller's end of the loop: it answers the newest measurement at once.

Safety: a measurement that is not finite or older than the last one is not answered, and the answer
is within the limit. Without measurements the controller sends the safe command for some time, in
case the return path still works; then it stops and accepts another plant.
"""

from __future__ import annotations

import asyncio
import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deadtime._base.validation import finite, positive
from deadtime.links.addresses import Address
from deadtime.links.udp.endpoint import Endpoint
from deadtime.links.udp.loop_end import LoopEnd
from deadtime.links.udp.packets import LoopPacket
from deadtime.links.udp.statistics import LinkReport, Percentiles
from deadtime.links.udp.wires import SAFE, wire_of
from deadtime.recordings import Recording

#: Columns of the controller's recording.
COLUMNS = ("time_s", "reference", "output", "command", "measured_s")

#: Duration for which the safe command is repeated, in watchdog times, and repetitions in each.
REPEATED, EACH = 4, 10


@dataclass(frozen=True)
class ControllerOptions:
    """Options of the controller's end: command = gain (reference - output).

    Parameters
    ----------
    gain : float
        Gain of the controller, 1/s for an integrator.
    listen : (str, int)
        Address for receiving; port 0 takes a free one.
    plant : (str, int) or None
        The plant that is answered; None for the first sender of a measurement, until it is silent.
    limit : float
        Largest size of the command.
    watchdog : float
        Longest time without a measurement, s.
    safe : float
        The command that is sent when the watchdog trips; a plant that reads its flag applies its
        own safe command.
    every : bool
        Answer every measurement, as a plant with a jitter buffer requires; otherwise the newest
        only.
    recording : Path or None
        CSV file, written row by row.
    doubles : (int, int) or None
        Use plain doubles: their number from the plant and to it.
    """

    gain: float
    listen: Address = ("127.0.0.1", 0)
    plant: Address | None = None
    limit: float = 20.0
    watchdog: float = 0.5
    safe: float = 0.0
    every: bool = False
    recording: Path | None = None
    doubles: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        finite("gain", self.gain)
        positive("limit", self.limit)
        positive("watchdog", self.watchdog)
        if abs(finite("safe", self.safe)) > self.limit:
            raise ValueError(f"safe={self.safe} exceeds limit={self.limit}: give a smaller safe")


@dataclass(frozen=True, eq=False)
class ControllerReport:
    """Report of the controller; recording and times are those of the last 100 000 packets.

    Attributes
    ----------
    link : LinkReport
        The packets from the plant.
    period : Percentiles
        Time between two answers, s.
    answered : int
        Measurements that were answered.
    drained : int
        Measurements that were skipped for a newer one.
    trips : int
        How often the watchdog tripped.
    largest_command : float
        Largest size.
    recording : Recording or None
        Time by this clock from the first measurement on, reference, received output, sent
        command; None if the run was too short.
    """

    link: LinkReport
    period: Percentiles
    answered: int
    drained: int
    trips: int
    largest_command: float
    recording: Recording | None

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON; without the recording."""
        plain = {**vars(self), "link": self.link.to_dict(), "period": vars(self.period)}
        del plain["recording"]
        return plain


class Controller(LoopEnd):
    """A running controller: ``async with Controller(options) as controller``."""

    def __init__(self, options: ControllerOptions) -> None:
        self.options = options
        endpoint = Endpoint(wire_of(options.doubles), self._take, options.plant)
        super().__init__(endpoint, "the controller")
        self._newest = 0
        self._sequence = 0
        self._last: tuple[LoopPacket, float] | None = None
        self._watchdog: asyncio.TimerHandle | None = None
        self._started = math.nan
        self._answered = self._drained = self._trips = 0
        self._largest = 0.0

    async def __aenter__(self) -> Controller:
        await self._open(self.options.listen, self.options.recording, COLUMNS)
        return self

    async def __aexit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._watchdog is not None:
            self._watchdog.cancel()
        self._send_safe()  # so that the plant need not wait for its watchdog
        self._stack.close()
        if kind is None:
            self._endpoint.check()

    async def running(self, time: float) -> None:
        """Run for `time` seconds.

        Raises errors that stop the loop, for example `OSError` when the disk is full.
        """
        await self._endpoint.running(time)

    def _take(self, batch: list[tuple[LoopPacket, float]]) -> None:
        """Answer the newest measurement of a batch, or every one."""
        statistics = self._endpoint.statistics
        fresh = []
        for packet, read in batch:
            if self.options.every:
                self._answer(packet, read)
            elif packet.sequence > self._newest:
                fresh.append((packet, read))
            else:
                statistics.add_late(self._lateness(packet))
        if not fresh:
            return
        packet, read = max(fresh, key=lambda arrival: arrival[0].sequence)
        self._drained += len(fresh) - 1
        self._answer(packet, read)

    def _lateness(self, packet: LoopPacket) -> float:
        """By how much a measurement is older than the last answered one, s."""
        return max(0.0, self._last[0].sent - packet.sent) if self._last is not None else 0.0

    def _answer(self, packet: LoopPacket, read: float) -> None:
        limit = self.options.limit
        error = packet.reference - packet.value
        command = max(-limit, min(limit, self.options.gain * error))
        now = self._send(command, packet, read)
        self._answered += 1
        self._largest = max(self._largest, abs(command))
        if math.isnan(self._started):
            self._started = now
        fresh = packet.sequence > self._newest
        if fresh and (not self._rows or now - self._started > self._rows[-1][0]):
            row = (now - self._started, packet.reference, packet.value, command, packet.sent)
            self._rows.append(row)
            if self._journal is not None:
                self._journal.write(row)
        if fresh:
            self._newest, self._last = packet.sequence, (packet, read)
        if self._watchdog is not None:
            self._watchdog.cancel()
        self._watchdog = self._loop.call_later(self.options.watchdog, self._trip, 0)

    def _send(self, command: float, packet: LoopPacket, read: float, flags: int = 0) -> float:
        """Send a command in answer to a measurement; return the time."""
        now = self._loop.time()
        self._sequence += 1
        self._endpoint.send(
            LoopPacket(
                sequence=self._sequence,
                sent=now,
                echo_sequence=packet.sequence,
                echo_sent=packet.sent,
                held=now - read,
                value=command,
                reference=packet.reference,
                flags=flags,
            )
        )
        return now

    def _send_safe(self) -> None:
        if self._last is not None:
            self._send(self.options.safe, *self._last, flags=SAFE)

    def _trip(self, times: int) -> None:
        """Send the safe command for some time, then accept another plant."""
        if times == 0:
            self._trips += 1
            self._newest = 0  # the same plant may restart
        if times == REPEATED * EACH:
            self._last, self._watchdog = None, None
            self._endpoint.forget_peer()
            return
        self._send_safe()
        again = self.options.watchdog / EACH
        self._watchdog = self._loop.call_later(again, self._trip, times + 1)

    def report(self) -> ControllerReport:
        """The report until now."""
        times = [row[0] for row in self._rows]
        return ControllerReport(
            link=self._endpoint.statistics.report(),
            period=Percentiles.of([b - a for a, b in itertools.pairwise(times)]),
            answered=self._answered,
            drained=self._drained,
            trips=self._trips,
            largest_command=self._largest,
            recording=self._recording(),
        )
