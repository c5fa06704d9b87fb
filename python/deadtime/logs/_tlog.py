"""Read tlog files: MAVLink packets with the time of the ground station before each.

The packets are found in one pass, and all messages of a type are decoded together, with the
definitions of pymavlink: one by one they would take a minute for a flight.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime._base.errors import RecordingError
from deadtime._base.extras import library
from deadtime.logs._ardupilot_modes import COPTER, PLANE, ROVER, SUB
from deadtime.logs._contents import LogContents, Topic
from deadtime.logs._link import Link, half_round_trip, lost_packets, transport_of
from deadtime.logs._mavlink_packets import (
    Batch,
    Packets,
    batches,
    find_packets,
    numbers_and_senders,
)
from deadtime.logs._names import UNITS
from deadtime.logs._px4_modes import MODES, VEHICLES, version_of
from deadtime.logs._windows import changes_of

#: ``MAV_AUTOPILOT`` of a heartbeat.
AUTOPILOTS = {3: "ArduPilot", 12: "PX4"}
NOT_AN_AUTOPILOT = 8

#: Flight modes of ArduPilot by ``MAV_TYPE``.
COPTERS = frozenset({2, 3, 4, 13, 14, 15, 29, 35})
PLANES = frozenset({1, 19, 20, 21, 22, 23, 24, 25})
ROVERS, SUBS = frozenset({10, 11}), frozenset({12})

#: Flight modes of PX4 by main mode, those of "auto" by sub mode.
PX4_MAIN = {1: 0, 2: 1, 3: 2, 5: 10, 6: 14, 7: 15}
PX4_AUTO = {2: 17, 3: 4, 4: 3, 5: 5, 6: 18, 8: 19, 9: 20}
AUTO = 4

#: Fields with a time of the vehicle's clock: when a message was made, and when its values were
#: measured, which may be long ago. The second tells the clock only where no message has the first.
BOOT, MEASURED = "time_boot_ms", "time_usec"

#: A clock of the vehicle that goes back by more than this, s, was started anew.
RESTART = 10.0

#: Times since 1970 are larger than this, times since a start smaller, µs.
SINCE_1970 = 1e15


def read_tlog(data: bytes, source: str) -> LogContents:
    """All messages of a tlog, on the clock of the vehicle.

    The column ``ground_time`` of each topic holds the time at which the ground station received
    the message, s. Messages without a time of the vehicle are placed between their neighbours that
    have one. Topics of other senders are named by them, as ``"HEARTBEAT[255/190]"``.

    Raises
    ------
    MissingExtraError
        When pymavlink is not installed.
    RecordingError
        When no autopilot sends in it.
    """
    dialect = library(
        "pymavlink.dialects.v20.ardupilotmega", "reading tlog files", "'deadtime[logs]'"
    )
    packets = find_packets(data)
    found, damaged = batches(data, packets, dialect.mavlink_map)
    vehicle = _vehicle(found)
    if vehicle is None:
        raise RecordingError(
            f"{source} looks like a tlog, but contains no HEARTBEAT of an autopilot"
        )
    kind, pilot = (
        int(_values(found, "HEARTBEAT", name, vehicle)[-1]) for name in ("type", "autopilot")
    )
    remarks = []
    if packets.skipped:
        remarks.append(
            f"{packets.skipped} bytes of the file do not belong to a packet, and are left out"
        )
    if packets.cut:
        remarks.append("the file ends within a packet, so it was cut off")
    if damaged:
        remarks.append(f"{damaged} packets with a wrong checksum are left out")
    found, clock = _longest_without_restart(found, vehicle, remarks, source)
    topics = _topics(found, vehicle, clock)
    autopilot = AUTOPILOTS.get(pilot, "")
    return LogContents(
        format="tlog",
        autopilot=autopilot,
        vehicle=VEHICLES.get(kind, ""),
        firmware=_firmware(found, vehicle),
        topics=topics,
        parameters=_parameters(found, vehicle),
        modes=_modes(topics.get("HEARTBEAT"), autopilot, kind),
        remarks=tuple(remarks),
        span=(float(clock[1][0]), float(clock[1][-1])),
        link=_link(data, packets, found, vehicle, dialect.mavlink_map),
    )


Sender = tuple[int, int]
Clock = tuple[Array, Array]


def _vehicle(found: list[Batch]) -> Sender | None:
    """System and component of the autopilot that sends most heartbeats."""
    counts: dict[Sender, int] = {}
    for batch in found:
        if batch.name == "HEARTBEAT":
            pilots = batch.records["autopilot"] != NOT_AN_AUTOPILOT
            for sender, rows in batch.senders().items():
                count = int(np.count_nonzero(pilots[rows]))
                if count:
                    counts[sender] = counts.get(sender, 0) + count
    return max(counts, key=lambda sender: counts[sender]) if counts else None


def _longest_without_restart(
    found: list[Batch], vehicle: Sender, remarks: list[str], source: str
) -> tuple[list[Batch], Clock]:
    """The messages of the longest time without a restart, and its pairs of both clocks.

    Raises
    ------
    RecordingError
        When no message of the vehicle has a time.
    """
    at, received, sent = _clock_rows(found, vehicle, BOOT)
    if not at.size:
        at, received, sent = _clock_rows(found, vehicle, MEASURED)
    if not at.size:
        raise RecordingError(f"{source}: no message of the autopilot contains a time of its clock")
    starts = np.flatnonzero(np.diff(sent) < -RESTART) + 1
    edges = np.concatenate(([0], starts, [at.size]))
    longest = int(np.argmax(np.diff(edges)))
    low, high = edges[longest], edges[longest + 1]
    if starts.size:
        remarks.append(
            f"the vehicle's clock restarts {starts.size} times, so only the longest part is read"
        )
        first = at[low] if low else 0
        last = at[high] if high < at.size else np.inf
        found = [batch.taken((batch.places >= first) & (batch.places < last)) for batch in found]
    received, sent = received[low:high], np.maximum.accumulate(sent[low:high])
    order = np.argsort(received, kind="stable")
    return [batch for batch in found if batch.places.size], (received[order], np.sort(sent))


def _clock_rows(
    found: list[Batch], vehicle: Sender, field: str
) -> tuple[NDArray[np.int64], Array, Array]:
    """Places, times on the ground and times of the vehicle in all its messages with this field."""
    places, ground, clock = [np.empty(0, dtype=np.int64)], [np.empty(0)], [np.empty(0)]
    for batch in found:
        rows, time = batch.senders().get(vehicle), _vehicle_time(batch, field)
        if rows is not None and time is not None:
            rows = rows[np.isfinite(time[rows])]
            places.append(batch.places[rows])
            ground.append(batch.ground[rows])
            clock.append(time[rows])
    at = np.concatenate(places)
    order = np.argsort(at, kind="stable")
    return at[order], np.concatenate(ground)[order], np.concatenate(clock)[order]


def _vehicle_time(batch: Batch, field: str) -> Array | None:
    """The vehicle's clock in these messages, s, NaN where it is not known; None without a field."""
    if field not in (batch.records.dtype.names or ()):
        return None
    time = batch.records[field].astype(float)
    unit = 1e-3 if field == BOOT else 1e-6
    # A message without a time has 0, and GPS may tell that of the satellites.
    return np.where((time > 0.0) & (time < SINCE_1970), unit * time, np.nan)


def _link(
    data: bytes, packets: Packets, found: list[Batch], vehicle: Sender, known: Collection[int]
) -> Link | None:
    """The way of the vehicle's messages to the ground station; None where the log does not tell."""
    candidates = []
    for batch in found:
        rows, time = batch.senders().get(vehicle), _vehicle_time(batch, BOOT)
        if rows is not None and time is not None:
            rows = rows[np.isfinite(time[rows])]
            candidates.append((rows.size, batch.name, time[rows], batch.ground[rows]))
    if not candidates:
        return None
    count, name, sent, received = max(candidates, key=lambda candidate: candidate[:2])
    way = transport_of(sent, received)
    if way is None:
        return None
    transport, drift = way
    half, trips = _round_trip(found, vehicle)
    numbers = _numbers(data, packets, found, vehicle, known)
    return Link(
        name, count, float(np.median(transport)), float(np.quantile(transport, 0.95)), drift,
        half, trips, numbers.size, lost_packets(numbers),
    )  # fmt: skip


def _round_trip(found: list[Batch], vehicle: Sender) -> tuple[float | None, int]:
    """From the requests of others and the vehicle's answers, which have a time of its own."""
    for batch in found:
        if batch.name == "TIMESYNC":
            own = (batch.system == vehicle[0]) & (batch.component == vehicle[1])
            request = batch.records["tc1"] == 0
            number = batch.records["ts1"].astype(np.int64)
            asked, answered = ~own & request, own & ~request
            return half_round_trip(
                (number[asked], batch.ground[asked]), (number[answered], batch.ground[answered])
            )
    return None, 0


def _numbers(
    data: bytes, packets: Packets, found: list[Batch], vehicle: Sender, known: Collection[int]
) -> NDArray[np.uint8]:
    """Numbers of the vehicle's packets in their order, with those of unknown messages."""
    places = np.concatenate([batch.places for batch in found])
    kinds, every = np.array(packets.types), np.array(packets.places, dtype=np.int64)
    strange = every[~np.isin(kinds, list(known))]
    inside = (strange > places.min()) & (strange < places.max())
    content = np.frombuffer(data, dtype=np.uint8)
    places = np.sort(np.concatenate([places, strange[inside]]))
    number, system, component = numbers_and_senders(content, places)
    return np.asarray(number[(system == vehicle[0]) & (component == vehicle[1])])


def _topics(found: list[Batch], vehicle: Sender, clock: Clock) -> dict[str, Topic]:
    """Topics of all senders; the plain name is the vehicle's, else that of who sends most."""
    topics = {}
    for batch in found:
        senders = batch.senders()
        main = vehicle if vehicle in senders else max(senders, key=lambda node: senders[node].size)
        for sender, rows in senders.items():
            name = batch.name if sender == main else f"{batch.name}[{sender[0]}/{sender[1]}]"
            topics[name] = _topic(batch, rows, sender == vehicle, clock)
    return topics


def _topic(batch: Batch, rows: NDArray[np.int64], own: bool, clock: Clock) -> Topic:
    """The messages of one type from one sender."""
    ground = batch.ground[rows]
    seconds = np.interp(ground, *clock)
    for field in (BOOT, MEASURED):
        time = _vehicle_time(batch, field) if own else None
        if time is not None:
            # A fix that is lost keeps its time: that is not when the message was sent.
            near = np.abs(time[rows] - seconds) <= RESTART
            seconds = np.where(near, time[rows], seconds)
            break
    columns = {"ground_time": ground}
    units = {}
    for name in batch.records.dtype.names or ():
        values = batch.records[name][rows]
        if values.dtype.kind == "S":
            continue
        flat = values.reshape(rows.size, -1).astype(float)
        for k in range(flat.shape[1]):
            shown = name if values.ndim == 1 else f"{name}[{k}]"
            columns[shown] = flat[:, k]
            unit = batch.units.get(name, "")
            if unit in UNITS:
                units[shown] = unit
    return Topic(seconds, columns, units)


def _values(found: list[Batch], name: str, column: str, vehicle: Sender) -> NDArray[Any]:
    """A column of the vehicle's messages of one type; empty if there are none."""
    for batch in found:
        if batch.name == name and vehicle in batch.senders():
            return np.asarray(batch.records[column][batch.senders()[vehicle]])
    return np.empty(0)


def _texts(found: list[Batch], name: str, column: str, vehicle: Sender) -> list[str]:
    """A column of texts of the vehicle."""
    texts = _values(found, name, column, vehicle).tolist()
    return [text.split(b"\0")[0].decode("utf-8", "replace") for text in texts]


def _parameters(found: list[Batch], vehicle: Sender) -> dict[str, float]:
    names = _texts(found, "PARAM_VALUE", "param_id", vehicle)
    values = _values(found, "PARAM_VALUE", "param_value", vehicle).astype(float).tolist()
    return {name: value for name, value in zip(names, values, strict=True) if name}


def _firmware(found: list[Batch], vehicle: Sender) -> str:
    """From the text at the start, else from the number of the version."""
    for text in _texts(found, "STATUSTEXT", "text", vehicle):
        if " V" in text and text.startswith(("Ardu", "APM", "Rover", "Blimp")):
            return text
    versions = _values(found, "AUTOPILOT_VERSION", "flight_sw_version", vehicle)
    return version_of(int(versions[-1])) if versions.size else ""


def _modes(heartbeat: Topic | None, autopilot: str, kind: int) -> tuple[tuple[float, str], ...]:
    if heartbeat is None:  # none in the part that is read
        return ()
    numbers = heartbeat.columns["custom_mode"].astype(np.int64)
    changes = changes_of(heartbeat.time, numbers)
    return tuple((at, _mode(number, autopilot, kind)) for at, number in changes)


def _mode(number: int, autopilot: str, kind: int) -> str:
    if autopilot == "PX4":
        main, sub = number >> 16 & 0xFF, number >> 24 & 0xFF
        state = PX4_AUTO.get(sub) if main == AUTO else PX4_MAIN.get(main)
        return f"mode {number}" if state is None else MODES[state]
    tables = ((COPTERS, COPTER), (PLANES, PLANE), (ROVERS, ROVER), (SUBS, SUB))
    table = next((modes for kinds, modes in tables if autopilot and kind in kinds), {})
    return table.get(number, f"mode {number}")
