"""The plant's end of the loop: it samples, sends its output and applies commands.

Safety: a command is applied only if it is finite, within the limit, newer than the one in force,
and answers a measurement no older than the watchdog time. Without such a command for that time, the
safe command is applied until one arrives. The watchdog runs at the plant, so it does not depend on
the network or the controller.
"""

from __future__ import annotations

import asyncio
import math
from collections import deque

from deadtime.links.udp.classifier import REMEMBERED
from deadtime.links.udp.endpoint import Endpoint
from deadtime.links.udp.integrator import HeldIntegrator
from deadtime.links.udp.loop_end import LoopEnd
from deadtime.links.udp.packets import LoopPacket
from deadtime.links.udp.plant_options import PlantOptions, PlantReport
from deadtime.links.udp.statistics import KEPT, Percentiles
from deadtime.links.udp.wires import SAFE, wire_of

#: Columns of the plant's recording.
COLUMNS = ("time_s", "reference", "output", "command", "age_s")


async def run_plant(options: PlantOptions) -> PlantReport:
    """Run the plant's end of the loop in the running event loop, real or virtual.

    Raises
    ------
    LinkError
        When the address does not exist, or no socket can be opened.
    OSError
        When the recording cannot be written; the safe command is in force then.
    """
    async with Plant(options) as plant:
        await plant.running()
        return plant.report()


class Plant(LoopEnd):
    """A running plant: ``async with Plant(options) as plant``."""

    def __init__(self, options: PlantOptions) -> None:
        self.options = options
        self._wire = wire_of(options.doubles)
        # More than can be answered in time, to distinguish late answers from impossible ones.
        remembered = max(REMEMBERED, 2 * math.ceil(options.watchdog / options.sample_time))
        endpoint = Endpoint(
            self._wire, self._take, options.controller, answers_only=True, remembered=remembered
        )
        super().__init__(endpoint, "the plant")
        self._model = HeldIntegrator(options.gain, options.lag)
        self._command, self._stamp = options.safe, math.nan
        self._newest = 0
        self._sequence = 0
        self._echo: tuple[LoopPacket, float] | None = None
        self._watchdog: asyncio.TimerHandle | None = None
        self._hold: asyncio.TimerHandle | None = None
        self._tick: asyncio.Handle | None = None
        self._waiting: set[asyncio.TimerHandle] = set()
        self._periods: deque[float] = deque(maxlen=KEPT)
        self._ages: deque[float] = deque(maxlen=KEPT)
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=KEPT)
        self._age_area = self._age_time = self._oldest = 0.0
        self._overruns = self._applied = self._trips = 0
        self._safe_since: float | None = None
        self._safe_time = 0.0
        self._largest_command = self._largest_output = 0.0

    async def __aenter__(self) -> Plant:
        await self._open(self.options.listen, self.options.recording, COLUMNS)
        self._started = self._clock = self._loop.time()
        self._due = 0
        self._tick = self._loop.call_soon(self._sample)
        return self

    async def __aexit__(self, *_: object) -> None:
        for timer in (self._tick, self._watchdog, self._hold, *self._waiting):
            if timer is not None:
                timer.cancel()
        self._command = self.options.safe
        self._stack.close()

    async def running(self) -> None:
        """Run for the duration of the options; raises errors that stop the loop."""
        await self._endpoint.running(self.options.duration)

    def _pass_time(self, now: float) -> None:
        """Advance the plant and the mean age of the command to now."""
        before, self._clock = self._clock, max(now, self._clock)
        self._model.advance(self._clock - before, self._command)
        self._largest_output = max(self._largest_output, abs(self._model.output))
        if math.isfinite(self._stamp):
            old, new = before - self._stamp, self._clock - self._stamp
            self._age_area += 0.5 * (new * new - old * old)
            self._age_time += self._clock - before
            self._oldest = max(self._oldest, new)

    def _sample(self) -> None:
        """Measure, send and record, and schedule the next measurement."""
        try:
            self._measure()
        except Exception as error:  # for example a full disk: without samples the loop has to stop
            self._endpoint.fail(error)
            self._make_safe()
            return
        due = self._due + 1
        latest = math.floor((self._loop.time() - self._started) / self.options.sample_time + 1e-6)
        self._overruns += max(0, latest - due)
        self._due = max(due, latest)
        self._tick = self._loop.call_at(
            self._started + self._due * self.options.sample_time, self._sample
        )

    def _measure(self) -> None:
        now = self._loop.time()
        self._pass_time(now)
        elapsed = now - self._started
        # The time of the step may be missed by rounding.
        stepped = elapsed >= self.options.rest - 1e-9
        reference = self.options.amplitude if stepped else 0.0
        output = self._model.output
        echo, read = self._echo or (None, now)
        self._sequence += 1
        self._endpoint.send(
            LoopPacket(
                sequence=self._sequence,
                sent=now,
                echo_sequence=0 if echo is None else echo.sequence,
                echo_sent=0.0 if echo is None else echo.sent,
                held=now - read,
                value=output,
                reference=reference,
            )
        )
        if self._rows:
            self._periods.append(elapsed - self._rows[-1][0])
        if not self._rows or elapsed > self._rows[-1][0]:
            row = (elapsed, reference, output, self._command)
            self._rows.append(row)
            if self._journal is not None:
                age = now - self._stamp
                self._journal.write((*row, age if math.isfinite(age) else None))

    def _take(self, batch: list[tuple[LoopPacket, float]]) -> None:
        for packet, read in batch:
            self._judge(packet, read)

    def _judge(self, packet: LoopPacket, read: float) -> None:
        """Apply a command now, later or not at all."""
        statistics = self._endpoint.statistics
        # Commands are ordered by the numbers of the plant: a restarted controller has new numbers.
        number = packet.echo_sequence if self._wire.has_times else packet.sequence
        age = read - packet.echo_sent if self._wire.has_times else 0.0
        if packet.flags & SAFE:
            if number >= self._newest:
                self._newest = number
                self._make_safe()
                self._arm_watchdog()
            return
        if self._wire.has_times:
            self._echo = (packet, read)
            self._arrivals.append((number, age))
            if age > self.options.watchdog:
                statistics.add_late(age - self.options.watchdog)
                return
        if number <= self._newest:
            statistics.add_late(self._behind(age))
            return
        wait = self.options.policy.wait(age)
        if wait is None:
            statistics.add_late(age - self.options.policy.oldest)
            return
        if wait == 0.0:
            self._apply(packet, number)
        else:
            self._apply_after(wait, packet, number)

    def _behind(self, age: float) -> float:
        """By how much a command of this age is older than the one in force, s."""
        return max(0.0, age - (self._loop.time() - self._stamp)) if self._ages else 0.0

    def _apply_after(self, wait: float, packet: LoopPacket, number: int) -> None:
        def apply() -> None:
            self._waiting.discard(timer)
            if number > self._newest:
                self._apply(packet, number)

        timer = self._loop.call_later(wait, apply)
        self._waiting.add(timer)

    def _apply(self, packet: LoopPacket, number: int) -> None:
        now = self._loop.time()
        self._pass_time(now)
        self._newest = number
        limit = self.options.limit
        self._command = max(-limit, min(limit, packet.value))  # the value is finite
        self._largest_command = max(self._largest_command, abs(self._command))
        self._applied += 1
        if self._wire.has_times:
            self._stamp = packet.echo_sent
            self._ages.append(now - packet.echo_sent)
        if self._safe_since is not None:
            self._safe_time += now - self._safe_since
            self._safe_since = None
        self._arm_watchdog()
        if self._hold is not None:
            self._hold.cancel()
        if self.options.policy.holds is not None:
            held = self.options.policy.holds * self.options.sample_time
            self._hold = self._loop.call_later(held, self._end_hold)

    def _arm_watchdog(self) -> None:
        if self._watchdog is not None:
            self._watchdog.cancel()
        self._watchdog = self._loop.call_later(self.options.watchdog, self._watchdog_trips)

    def _end_hold(self) -> None:
        """End the hold of the last command."""
        self._pass_time(self._loop.time())
        self._command, self._stamp = 0.0, math.nan

    def _watchdog_trips(self) -> None:
        """Apply the safe command, and accept a restarted controller."""
        self._endpoint.forget_peer()
        self._make_safe()

    def _make_safe(self) -> None:
        """Apply the safe command of this end."""
        now = self._loop.time()
        self._pass_time(now)
        for timer in (self._hold, *self._waiting):
            if timer is not None:
                timer.cancel()
        self._waiting.clear()
        self._command, self._stamp = self.options.safe, math.nan
        if self._safe_since is None:
            self._safe_since = now
            self._trips += 1

    def report(self) -> PlantReport:
        """The report until now."""
        self._pass_time(self._loop.time())
        since = self._clock if self._safe_since is None else self._safe_since
        return PlantReport(
            link=self._endpoint.statistics.report(),
            period=Percentiles.of(self._periods),
            overruns=self._overruns,
            applied=self._applied,
            age=self._age_area / self._age_time if self._age_time else math.nan,
            oldest=self._oldest,
            age_when_applied=Percentiles.of(self._ages),
            trips=self._trips,
            safe_time=self._safe_time + (self._clock - since),
            largest_command=self._largest_command,
            largest_output=self._largest_output,
            arrivals=tuple(self._arrivals),
            recording=self._recording(),
        )
