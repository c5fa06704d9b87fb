"""Fly steps against ArduPilot's Copter in its software-in-the-loop build, and keep the recordings.

A P controller outside the vehicle sends velocity commands every 65 ms and reads the position that
the vehicle reports. Commands wait in a queue for a known time before they are sent, so the delay of
the loop is that of the vehicle and this time. The firmware runs at the speed of the clock.

Times are those of the vehicle. Each position comes with the time of the vehicle at which it was
reported; the difference between the time at which it was received and this time is, at its least,
the offset between the two clocks. A line through the least differences of every two seconds, which
allows for clocks of different rates, converts the times of commands; positions are interpolated
between the reports, by their velocities, at these times.

When a command is computed, it is also sent at once as a mark, in a message that the vehicle writes
to its own log and does not obey. That log is kept: it tells without another clock when commands
were computed, when they were sent, and how the vehicle moved (`reality.dataflash`).

Run ``python benches/reality/flights.py ARDUCOPTER FOLDER FLIGHT ...`` where nothing else is on the
network: the firmware opens ports on all interfaces, so `firmware.fly` starts it in a network
namespace of its own. A flight is named as ``height-calm-0.100-1``: axis, calm or wind, time in s
added to the commands, and repeat. Requires pymavlink.
"""

from __future__ import annotations

import asyncio
import json
import math
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from deadtime.links import Limits, VehicleState, now
from deadtime.links.mavlink import MAVLinkVehicle
from deadtime.links.mavlink.codec import dialect
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

Array = NDArray[np.float64]

PORT = 14650

#: Time between commands, s; largest command, m/s; height of the flights, m.
SAMPLE, LIMIT, HEIGHT = 0.065, 1.0, 10.0

#: Proportional gains, 1/s, by axis.
GAINS = {"height": 1.0, "north": 0.6}

#: Size of a step, m; rest before the first, and time for each, s; their number.
STEP, REST, HOLD, STEPS = 1.0, 4.0, 8.0, 4

#: Time for the vehicle to come to rest before the recording begins, s.
APPROACH = 6.0

#: Wind in m/s and turbulence of the simulated atmosphere.
WINDS = {"calm": (0.0, 0.0), "wind": (5.0, 1.0)}

#: A row that is later than this, in s, keeps the time at which its command was computed; the others
#: have the time at which it was due.
LATE = 0.002

#: Time over which the least difference of clocks is sought, s.
STRETCH = 2.0

#: Wall time in s after which the firmware ends, whatever has become of this process.
LONGEST = 3600.0

#: Bits of what the vehicle logs that are added: attitude and position at 25 Hz and faster.
LOGGED = 1

#: What shapes a velocity command by axis: acceleration in cm/s², jerk in m/s³.
SHAPING = {"height": ("WPNAV_ACCEL_Z", "PSC_JERK_Z"), "north": ("WPNAV_ACCEL", "PSC_JERK_XY")}


class Flight(NamedTuple):
    """What is flown."""

    axis: str
    wind: str
    added: float
    repeat: int

    @property
    def name(self) -> str:
        """As in file names."""
        return f"{self.axis}-{self.wind}-{self.added:.3f}-{self.repeat}"

    @classmethod
    def of(cls, name: str) -> Flight:
        """The flight of this name."""
        axis, wind, added, repeat = name.split("-")
        if axis not in GAINS or wind not in WINDS:
            raise ValueError(f"no flight {name!r}: name one as height-calm-0.100-1")
        return cls(axis, wind, float(added), int(repeat))


class Position(NamedTuple):
    """What the vehicle reported: when received, its own time, north and height with velocities."""

    received: float
    stamp: float
    north: float
    height: float
    north_speed: float
    climb: float

    @classmethod
    def of(cls, state: VehicleState) -> Position:
        """From a message."""
        reported = (state.vehicle_time, state.north, state.height, state.north_speed, state.climb)
        assert None not in reported
        return cls(state.time, *reported)  # type: ignore[arg-type]


def limits() -> Limits:
    """Those of the flights: as wide as the vehicle has them itself, but for the height."""
    return Limits(
        max_climb=LIMIT,
        max_speed=LIMIT,
        max_height=2.0 * HEIGHT,
        max_angle=math.radians(30.0),
        landing_after=5.0,
    )


def send_velocity(vehicle: MAVLinkVehicle, axis: str, value: float) -> None:
    """Command a velocity in m/s, up or to the north."""
    north, up = (value, 0.0) if axis == "north" else (0.0, value)
    vehicle.command_velocity(north=north, up=up)


def mark(vehicle: MAVLinkVehicle, command: float, reference: float, number: int) -> None:
    """Let the vehicle write a command to its log as one that it does not know."""
    d, link = dialect(), vehicle._link
    values = (command, reference, float(number), 0.0, 0.0, 0.0, 0.0)
    link.send(d.MAVLink_command_long_message(*link.target, d.MAV_CMD_USER_1, 0, *values))


async def set_wind(vehicle: MAVLinkVehicle, wind: str) -> None:
    """Set the simulated atmosphere."""
    for name, value in zip(("SIM_WIND_SPD", "SIM_WIND_TURB"), WINDS[wind], strict=True):
        await vehicle.set_parameter(name, value)


@asynccontextmanager
async def hovering(vehicle: MAVLinkVehicle) -> AsyncIterator[None]:
    """Command it to hover meanwhile: without commands it would land."""

    async def hover() -> None:
        while True:
            vehicle.hover()
            await asyncio.sleep(0.1)

    task = asyncio.create_task(hover())
    try:
        yield
    finally:
        task.cancel()


@dataclass
class Log:
    """One flight: rows of (time computed, planned, reference, measured, command), when commands
    were due and sent, and positions.
    """

    rows: list[tuple[float, float, float, float, float]]
    sent: list[tuple[float, float]]
    positions: list[Position]


async def fly(vehicle: MAVLinkVehicle, flight: Flight, number: int) -> Log:
    """Fly the steps of one flight, the given one of its session."""
    log = Log([], [], [])
    position = Position.of(await vehicle.state())
    base = round(position.north) if flight.axis == "north" else HEIGHT
    vehicle.listen(lambda state: log.positions.append(Position.of(state)))
    queue: deque[tuple[float, float]] = deque()
    start = now() + 0.05
    samples = math.ceil((APPROACH + REST + STEPS * HOLD) / SAMPLE)

    async def send_until(due: float) -> None:
        """Send what has waited for long enough, until the next sample is due."""
        while queue and queue[0][0] < due:
            until, command = queue.popleft()
            await asyncio.sleep(until - now())
            send_velocity(vehicle, flight.axis, command)
            log.sent.append((until, now()))
        await asyncio.sleep(due - now())

    for sample in range(samples):
        due = start + sample * SAMPLE
        await send_until(due)
        since = sample * SAMPLE - APPROACH - REST
        reference = base + STEP * (since >= 0.0 and int(since // HOLD) % 2 == 0)
        position = Position.of(await vehicle.state())
        measured = position.north if flight.axis == "north" else position.height
        wanted = GAINS[flight.axis] * (reference - measured)
        command = min(max(wanted, -LIMIT), LIMIT)
        time = now()
        if time - position.received > 1.0:
            raise TimeoutError("the firmware has reported no position for 1 s")
        mark(vehicle, command, reference, number)
        if flight.added:
            queue.append((time + flight.added, command))
        else:
            send_velocity(vehicle, flight.axis, command)
            log.sent.append((time, now()))
        log.rows.append((time, due, reference, measured, command))
    await asyncio.sleep(0.2)
    vehicle.listen(None)
    vehicle.hover()
    return log


def clock_of(positions: Sequence[Position]) -> tuple[float, float, float]:
    """Rate and offset of the vehicle's time over the received times, and the largest misfit in s.

    The misfit is that of the least differences to the line.
    """
    received = np.array([one.received for one in positions])
    differences = received - np.array([one.stamp for one in positions])
    places = ((received - received[0]) / STRETCH).astype(int)
    least = np.array(
        [
            min(np.flatnonzero(places == place), key=lambda i: differences[i])
            for place in np.unique(places)[:-1]
        ]
    )
    x, y = received[least] - received[0], differences[least]
    slope, offset = np.polyfit(x, y, 1)
    misfit = float(np.max(np.abs(y - slope * x - offset)))
    return 1.0 - float(slope), float(offset - slope * received[0]), misfit


def rms_and_max(late: Array) -> list[float]:
    """Root mean square, and the largest, in s."""
    return [float(np.sqrt(np.mean(late**2))), float(np.max(late))]


def write(
    folder: Path, flight: Flight, log: Log, parameters: dict[str, float], place: dict[str, Any]
) -> None:
    """Write the recording, in the vehicle's time, and what is to be known of it.

    `place` says which log of the vehicle holds the flight, and under which number.
    """
    rate, offset, misfit = clock_of(log.positions)
    table = np.array(log.positions)
    table = table[np.r_[True, np.diff(table[:, 1]) > 0.0]]
    axis = (2, 4) if flight.axis == "north" else (3, 5)
    path = CubicHermiteSpline(table[:, 1], table[:, axis[0]], table[:, axis[1]])
    rows = np.array(log.rows)
    late = rows[:, 0] - rows[:, 1]
    times = rate * np.where(late < LATE, rows[:, 1], rows[:, 0]) - offset
    kept = times >= times[0] + APPROACH
    columns = np.c_[times, rows[:, 2], path(times), rows[:, 4]][kept]
    columns[:, 0] -= columns[0, 0]
    np.savetxt(
        folder / f"{flight.name}.csv",
        columns,
        fmt="%.9f",
        delimiter=",",
        header="time,reference,output,command",
        comments="",
    )
    facts = {
        "clock_rate": rate,
        "clock_misfit": misfit,
        "late": rms_and_max(late),
        "sent_late": rms_and_max(np.diff(np.array(log.sent), axis=1)[:, 0]),
        "positions_each_second": float(1.0 / np.median(np.diff(table[:, 1]))),
        "parameters": parameters,
        **place,
    }
    (folder / f"{flight.name}.json").write_text(json.dumps(facts, indent=1) + "\n")


async def session(folder: Path, flights: Sequence[Flight]) -> None:
    """Fly all flights in one, from take-off to landing."""
    address = f"udp:127.0.0.1:{PORT}"
    async with MAVLinkVehicle(address, limits(), take_off_height=HEIGHT) as vehicle:
        kept = int(await vehicle.parameter("LOG_BITMASK"))
        await vehicle.set_parameter("LOG_BITMASK", float(kept | LOGGED))
        names = [name for pair in SHAPING.values() for name in pair]
        parameters = {name: await vehicle.parameter(name) for name in names}
        await vehicle.take_off()
        wind = None
        for number, flight in enumerate(flights):
            if flight.wind != wind:
                async with hovering(vehicle):
                    await set_wind(vehicle, wind := flight.wind)
            log = await fly(vehicle, flight, number)
            place = {"log": f"{flights[0].name}.bin", "number": number}
            async with hovering(vehicle):  # beside the link, which must not wait
                await asyncio.to_thread(write, folder, flight, log, parameters, place)
            print(flight.name, flush=True)


def run(arducopter: Path, folder: Path, flights: Sequence[Flight]) -> None:
    """Fly in one session of the firmware, and end it in any case."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as own, (folder / "firmware.log").open("a") as said:
        options = (
            f"--model quad --speedup 1 --home 38.7,-9.1,100,0 -w -I0 --serial1 none --serial2 none "
            f"--serial0 udpclient:127.0.0.1:{PORT} --defaults"
        ).split()
        defaults = str(arducopter.parent / "copter.parm")
        firmware = subprocess.Popen(
            ["timeout", f"{LONGEST:g}", str(arducopter), *options, defaults],
            cwd=own,
            stdout=said,
            stderr=said,
        )
        try:
            asyncio.run(session(folder, flights))
        finally:
            firmware.send_signal(signal.SIGTERM)
            try:
                firmware.wait(5.0)
            except subprocess.TimeoutExpired:
                firmware.kill()
                firmware.wait()
            for kept in Path(own, "logs").glob("*.BIN"):
                shutil.copy(kept, folder / f"{flights[0].name}.bin")


if __name__ == "__main__":
    run(Path(sys.argv[1]), Path(sys.argv[2]), [Flight.of(name) for name in sys.argv[3:]])
