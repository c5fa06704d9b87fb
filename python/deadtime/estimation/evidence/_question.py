"""What is asked of the kernel: a record, and what the caller knows of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, TypeAlias

import numpy as np

import deadtime.estimation._native as native
from deadtime._base.arrays import Array
from deadtime._base.errors import RecordingError
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.validation import OpenRange, open_interval, positive
from deadtime.estimation.data._checks import given_recordings, one_each
from deadtime.estimation.data._simulated import commands_by_law, on_its_row, rows_off
from deadtime.loops import Controller, ControlLoop, Integrator, P
from deadtime.recordings import Recording

#: How the command moves between two rows.
Between: TypeAlias = Literal["held", "straight", "samples", "undecided"]

#: The kinds of plant that compete, by name.
PLANTS = (
    "delay",
    "lag",
    "two lags",
    "two lags, zero",
    "integrator",
    "integrator, lag",
    "integrator, lag, zero",
    "integrator, two lags",
    "integrator, two lags, zero",
)


#: What the kernel is told of all records together, by its names.
ASKED = ("between", "closed_loop", "at_rest", "largest_delay", "plant", "integrates", "causes")


@dataclass(frozen=True, eq=False)
class Question(ReadOnlyArrays):
    """A record and what is known of it, as the kernel takes it.

    Attributes
    ----------
    recording : Recording
        The rows up to the end of the window; the first `earlier` of them lie before it.
    earlier : int
        Rows before the window: their commands count, their outputs do not.
    closed_loop : bool
        Whether a controller computes the command from the output.
    at_rest : bool or None
        Whether the plant was at rest at the first row; None: as the record shows.
    largest_delay : float or None
        Largest delay that is tried, s; None: a share of the record.
    between : str
        How the command moves between two rows.
    plant : str or None
        The kind of plant, one of `PLANTS`; None: all.
    controller : Controller or None
        The controller in the loop, where it is known.
    window : (low, high) or None
        The window as it was given, s.
    limit : float or None
        Largest size of the command of the controller.
    shift : int
        Rows by which the command was moved to those of its controller: above zero to later ones.
    integrates : bool or None
        Only kinds of plant that integrate, or only those that come to rest; None: all.
    hold : float
        For how long the controller holds each command, s; 0 where that is not known.
    causes : bool
        Whether what the plant lacks, and what the sensor did not read, is looked for.
    others : tuple of Question
        Further recordings of the same plant; only what is of one recording counts in them.
    """

    recording: Recording
    earlier: int = 0
    closed_loop: bool = False
    at_rest: bool | None = None
    largest_delay: float | None = None
    between: Between = "undecided"
    plant: str | None = None
    controller: Controller | None = None
    window: OpenRange | None = None
    limit: float | None = None
    shift: int = 0
    integrates: bool | None = None
    hold: float = 0.0
    causes: bool = True
    others: tuple[Question, ...] = ()

    @property
    def each(self) -> tuple[Question, ...]:
        """The question for each recording."""
        return (self, *self.others)

    def answer(
        self,
        progress: Callable[[int], object] | None = None,
        known: native.FamilyFit | None = None,
        noise: str | None = None,
    ) -> native.FamilyFit:
        """Ask the kernel; every interval of the answer is one of 95 %.

        With the answer to fewer rows, plants are looked for beside those alone; with a noise, under
        that alone.
        """
        records = [part.record for part in self.each]
        asked: dict[str, Any] = {name: getattr(self, name) for name in ASKED}
        return native.fit_family(records, **asked, noise=noise, progress=progress, known=known)

    def options(self) -> dict[str, Any]:
        """What was given besides the recording, as arguments of `estimate_delay`."""
        found: dict[str, Any] = {}
        for name in ("window", "controller"):
            own = [getattr(part, name) for part in self.each]
            found[name] = own[0] if own.count(own[0]) == len(own) else own
        for name in ("limit", "at_rest", "largest_delay", "integrates", "plant"):
            found[name] = getattr(self, name)
        found["hold"] = self.hold or None
        found["between"] = None if self.between == "undecided" else self.between
        if self.controller is None and self.closed_loop != shows_controller(self.recording):
            found["closed_loop"] = self.closed_loop
        return {name: value for name, value in found.items() if value is not None}

    def part(self, low: float, high: float) -> Question:
        """The same for the rows between two shares of the window; rows before them are kept."""
        rows = len(self.recording) - self.earlier
        first, last = (self.earlier + round(share * (rows - 1)) for share in (low, high))
        time = self.recording.time
        window = (float(time[first]), float(time[last]))
        recording = self.recording.window(None, window[1])
        return replace(self, recording=recording, earlier=first, window=window)

    @property
    def record(self) -> tuple[Array, Array, Array, int, Array | None, float]:
        """The recording as the kernel takes it."""
        own = self.recording
        sent, command = (None, self.command) if own.sent is None else own.sent
        if self.hold and self.between == "straight":
            sent = (own.time if sent is None else sent) + 0.5 * self.hold
        return own.time, command, own.output, self.earlier, sent, self.hold

    @property
    def command(self) -> Array:
        """The command of every row."""
        assert self.recording.command is not None
        return self.recording.command


def questions_of(
    recording: Recording | Sequence[Recording],
    window: OpenRange | Sequence[OpenRange | None] | None,
    known: Mapping[str, Any],
) -> Question:
    """The question about one recording, or about several of one plant."""
    recordings = given_recordings(recording)
    windows = one_each("window", window, len(recordings))
    controllers = one_each("controller", known["controller"], len(recordings))
    first, *others = map(partial(question_of, known=known), recordings, windows, controllers)
    in_loop = any(asked.closed_loop for asked in (first, *others))
    return replace(first, closed_loop=in_loop, others=tuple(others))


def question_of(
    recording: Recording,
    window: OpenRange | None,
    controller: Controller | None,
    known: Mapping[str, Any],
) -> Question:
    """Check what the caller has given of one recording; what is None is not `known`."""
    given = {name: value for name, value in known.items() if value is not None}
    given["controller"] = controller
    limit = given.get("limit")
    if not isinstance(recording, Recording):
        raise TypeError(f"recording must be a Recording, not {type(recording).__name__}")
    shift = 0
    if controller is not None:
        recording, shift = _with_command(recording, controller, limit)
    elif limit is not None:
        raise ValueError(
            f"limit={limit!r} is a limit of the controller, but "
            "no controller is given: give the controller too"
        )
    if recording.command is None:
        raise RecordingError(
            "the recording has no command, so nothing shows what moved the plant. Name the "
            "column of the command, as in read_recording(..., command='OP'), or give the loop"
        )
    if (hold := given.get("hold")) and not 0.0 < hold < math.inf:
        raise ValueError(f"hold={hold!r} s: give a time above zero")
    if (plant := given.get("plant", PLANTS[0])) not in PLANTS:
        raise ValueError(f"plant={plant!r} is not one of {', '.join(map(repr, PLANTS))}")
    if "largest_delay" in given:
        positive("largest_delay", given["largest_delay"])
    low, high = open_interval("window", window)
    rows = recording.rows(low, high)
    part = recording.window(None, float(recording.time[rows.stop - 1]))
    given.setdefault("closed_loop", controller is not None or shows_controller(part))
    return Question(part, rows.start, window=window, shift=shift, **given)


def _with_command(
    recording: Recording, controller: Controller, limit: float | None
) -> tuple[Recording, int]:
    """The recording with the command of its controller, and by how many rows it was moved."""
    loop = ControlLoop(Integrator(), controller, limit=limit)
    has_law = isinstance(controller, P) and recording.has_reference
    if recording.command is None and not has_law:
        raise RecordingError(
            "the recording has no command, which can be computed from reference "
            "and output only for a P controller. Name the column of the command"
        )
    if recording.command is None:
        return replace(recording, command=commands_by_law(recording, loop)), 0
    check = recording.check(loop) if has_law else None
    if check is None or not (rows := rows_off(check)):
        return recording, 0
    return on_its_row(recording, loop, check), -rows


def shows_controller(recording: Recording) -> bool:
    """Whether there is a reference that moves and is not the command itself."""
    command = recording.command
    copied = command is not None and np.array_equal(recording.reference, command)
    return bool(recording.steps()) and not copied
