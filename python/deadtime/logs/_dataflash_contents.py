"""What the messages of a DataFlash log tell: vehicle, parameters, modes and events."""

from __future__ import annotations

from collections import ChainMap

import numpy as np

from deadtime._base.arrays import Array, Mask
from deadtime._base.errors import RecordingError
from deadtime.logs._ardupilot_modes import COPTER, PLANE, ROVER, SUB
from deadtime.logs._contents import LogContents, Topic
from deadtime.logs._dataflash_messages import Messages
from deadtime.logs._dataflash_vehicle import vehicle_of
from deadtime.logs._sdlog2 import MODES as PX4_MODES
from deadtime.logs._windows import changes_of

#: Letters of a commit that are shown.
SHORT_COMMIT = 10

#: Numbers of events.
ARMED, DISARMED, LANDED, FLYING = 10, 11, 18, 28

MODES = {"Copter": COPTER, "Plane": PLANE, "Rover": ROVER, "Sub": SUB}


def contents_of(form: str, source: str, messages: Messages, remarks: list[str]) -> LogContents:
    """The log's contents.

    Raises
    ------
    RecordingError
        When the file tells no format of a message that is in it.
    """
    if set(messages) <= {"FMT"}:
        raise RecordingError(
            f"{source} begins like a DataFlash log, but contains no message of a known format"
        )
    if messages.of_px4:
        return _contents_of_px4(messages, remarks)
    texts = messages.texts("MSG", "Message")
    parameters = _parameters(messages)
    vehicle, firmware, how = vehicle_of(messages, parameters)
    frame = next((text[6:].strip() for text in texts if text.startswith("Frame:")), "")
    return LogContents(
        format=form,
        autopilot="ArduPilot",
        vehicle=f"{vehicle} ({frame})" if vehicle and frame else vehicle or frame,
        firmware=firmware,
        topics=ChainMap(_events(messages), messages),  # type: ignore[arg-type]
        parameters=parameters,
        modes=_modes(messages, vehicle),
        remarks=(*remarks, *filter(None, [how])),
    )


def _contents_of_px4(messages: Messages, remarks: list[str]) -> LogContents:
    """What PX4 wrote in this frame before it had ULog."""
    modes: tuple[tuple[float, str], ...] = ()
    status = messages.get("STAT")
    if status is not None and "MainState" in status.columns:
        known = np.isfinite(status.time)
        numbers = status.columns["MainState"][known].astype(np.int64)
        changes = changes_of(status.time[known], numbers) if numbers.size else []
        modes = tuple((at, PX4_MODES.get(number, f"mode {number}")) for at, number in changes)
    return LogContents(
        format="sdlog2",
        autopilot="PX4",
        vehicle=next(iter(messages.texts("VER", "Arch")), ""),
        firmware=next(iter(messages.texts("VER", "FwGit")), "")[:SHORT_COMMIT],
        topics=messages,
        parameters=_parameters(messages),
        modes=modes,
        remarks=tuple(remarks),
    )


def _parameters(messages: Messages) -> dict[str, float]:
    topic = messages.get("PARM")
    if topic is None or "Value" not in topic.columns:
        return {}
    pairs = zip(messages.texts("PARM", "Name"), topic.columns["Value"].tolist(), strict=False)
    return {name: value for name, value in pairs if name}


def _modes(messages: Messages, vehicle: str) -> tuple[tuple[float, str], ...]:
    """The flight modes by their names."""
    topic = messages.get("MODE")
    if topic is None:
        return ()
    column = next((header for header in ("ModeNum", "Mode") if header in topic.columns), "")
    numbers = messages.texts("MODE", column)
    names = {str(number): name for number, name in MODES.get(vehicle, {}).items()}
    found: list[tuple[float, str]] = []
    for at, number in zip(topic.time.tolist(), numbers, strict=False):
        # Text logs may hold the name in place of the number.
        name = names.get(number, f"mode {number}" if number.isdigit() else number.upper())
        if np.isfinite(at) and (not found or found[-1][1] != name):
            found.append((at, name))
    return tuple(found)


def _events(messages: Messages) -> dict[str, Topic]:
    """Topics "armed" and "landed" from the messages that tell their changes, if there are any."""
    found = {}
    arming, events = messages.get("ARM"), messages.get("EV")
    if events is not None and "Id" in events.columns:
        number = events.columns["Id"]
        for name, on, off in (("armed", ARMED, DISARMED), ("landed", LANDED, FLYING)):
            rows = (number == on) | (number == off)
            found[name] = _changes(events.time[rows], number[rows] == on)
    if arming is not None and "ArmState" in arming.columns:
        found["armed"] = _changes(arming.time, arming.columns["ArmState"] > 0)
    return {name: topic for name, topic in found.items() if topic.time.size}


def _changes(time: Array, state: Mask) -> Topic:
    """A state that is logged when it changes: before the first row it was the other one."""
    rows = np.isfinite(time)
    time, state = time[rows], state[rows]
    if time.size:
        time = np.concatenate(([np.nextafter(time[0], -np.inf)], time))
        state = np.concatenate(([not state[0]], state))
    return Topic(time, {"state": state.astype(float)})
