"""The logged command against the controller: its law, its unit and sign, its limit.

The law of a P controller, u = Kp (r - y) within the limit, can be computed on each row. That of a
controller with an integral or a derivative depends on what lies between the rows and before them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from deadtime._base.arrays import Array, Mask
from deadtime.loops import ControlLoop, P
from deadtime.recordings._check_rows import Rows
from deadtime.recordings._findings import Columns, Finding, decimal_step, seconds

Law: TypeAlias = Literal["exact", "late", "early", "approximate", "differs", "unknown"]

#: The laws that are told apart row by row, and by how many rows each is late.
LAWS: tuple[tuple[Law, int], ...] = (("exact", 0), ("late", 1), ("early", -1))

#: Relative rounding of signals in single precision, and of the command.
SINGLE, ROUNDING = 2e-7, 1e-6

#: Share of rows that agree with a law which holds on every row but for strays, and by how many
#: tolerances a stray differs, or a command that moves.
AGREE, CLEARLY = 0.9, 4.0

#: Share by which more of the rows in which the command moves agree with a law that is late.
MORE = 0.3

#: Fewest rows in which the command moves that can tell laws apart.
FEWEST = 4

#: Differences from the law are noise if they leave this share of the variance of the command, or
#: are within this factor of the noise of the output.
EXPLAINED, WITHIN = 0.9, 1.5

#: Differences between the law and a command with hardly any values between its ends, as a share of
#: its range, that do not contradict the law.
FEW = 0.1

#: Relative error of the gain, and offset as a share of the range of the command, that count as
#: none, where the law holds but for noise and where it holds to rounding.
LOOSE, TIGHT = 0.05, 1e-3

#: The law, one row later or earlier, is better if it leaves less than this share of the difference.
BETTER = 0.5

#: Standard deviations by which a controller asks for more than a limit, or a gain differs.
BEYOND = 5.0

#: Factors between units; a gain within `LOOSE` of one is taken for it.
FACTORS = {100.0: "centimetres for metres", 1000.0: "millimetres for metres",
           180.0 / np.pi: "degrees for radians"}  # fmt: skip


class Line(NamedTuple):
    """The line u = slope w + offset + rest, and the share of the variance that it explains."""

    slope: float
    offset: float
    explained: float


class Command(NamedTuple):
    """What the command shows; `line` is that from the law to the command, where it differs."""

    law: Law = "unknown"
    line: Line | None = None
    strays: int = 0
    limit_seen: float | None = None
    saturated: float = 0.0


def read_command(columns: Columns, rows: Rows, loop: ControlLoop) -> Command:
    """Compare the logged command with that of the controller."""
    u, controller = columns.command, loop.controller
    if u is None or not isinstance(controller, P) or np.ptp(u) == 0.0:
        return Command(saturated=_share_at(columns.commands(loop), loop.limit))
    wanted = controller.Kp * (columns.reference - columns.output)
    size = max(float(np.max(np.abs(s))) for s in (columns.reference, columns.output))
    tolerance = ROUNDING * float(np.max(np.abs(u))) + 1.01 * (
        0.5 * decimal_step(u)
        + abs(controller.Kp) * (0.5 * decimal_step(columns.output) + SINGLE * size)
    )
    low, high = float(u.min()), float(u.max())
    clipped = np.clip(wanted, low, high)
    law, shift = _law_to_rounding(u, clipped, rows.adjacent, tolerance)
    beyond, line = CLEARLY * tolerance, None
    if law is None:
        noise = abs(controller.Kp) * noise_of_second_differences(columns.output)
        law, shift, line, error = _law_but_for_noise(u, wanted, rows.adjacent, noise)
        beyond += BEYOND * error
    if law in ("differs", "unknown"):
        return Command(law, line, saturated=_share_at(u, loop.limit))
    # Where the controller asked for more than the command, which is at its largest: the limit.
    own = np.roll(wanted, shift)
    at_end = ((own > high + beyond) & (u == high)) | ((own < low - beyond) & (u == low))
    seen = float(np.abs(u[at_end]).max()) if at_end.any() else None
    strays = int(np.count_nonzero(np.abs(u - clipped) > beyond)) if law == "exact" else 0
    limit = seen if loop.limit is None else loop.limit
    return Command(law, None, strays, seen, _share_at(u, limit))


def _share_at(commands: Array | None, limit: float | None) -> float:
    """Share of the rows in which the command is at its limit."""
    if commands is None or limit is None:
        return 0.0
    return float(np.mean(np.abs(commands) >= (1.0 - ROUNDING) * limit))


def noise_of_second_differences(values: Array) -> float:
    """Standard deviation of the noise on a smooth signal of at least three values."""
    return float(np.median(np.abs(np.diff(values, 2)))) / 0.6745 / float(np.sqrt(6.0))


def _law_to_rounding(
    u: Array, clipped: Array, adjacent: Mask, tolerance: float
) -> tuple[Law | None, int]:
    """The law that the command follows to rounding, if any, and by how many rows it is late."""
    inner = 1 + np.flatnonzero(adjacent[:-1] & adjacent[1:])
    moves = np.abs(np.diff(clipped)) > CLEARLY * tolerance
    moving = moves[inner - 1] & moves[inner]
    agree = [np.abs(u[inner] - clipped[inner - late]) <= tolerance for _, late in LAWS]
    if np.count_nonzero(moving) < FEWEST:
        return ("unknown" if np.mean(np.abs(u - clipped) <= tolerance) > AGREE else None), 0
    shares = [float(np.mean(agrees[moving])) for agrees in agree]
    best = int(np.argmax(shares))
    if float(np.mean(agree[best])) < AGREE or shares[best] < AGREE:
        return None, 0
    if best > 0 and shares[best] < shares[0] + MORE:
        best = 0
    return LAWS[best]


def _law_but_for_noise(
    u: Array, wanted: Array, adjacent: Mask, noise: float
) -> tuple[Law, int, Line | None, float]:
    """The law that the command follows but for `noise`, its line, and the rms of the rest."""
    low, high = float(u.min()), float(u.max())
    inner = 1 + np.flatnonzero(adjacent[:-1] & adjacent[1:])
    inner = inner[(u[inner] > low) & (u[inner] < high)]
    x = u[inner]
    if x.size < FEWEST or np.ptp(x) == 0.0:
        rest = float(np.sqrt(np.mean((u - np.clip(wanted, low, high)) ** 2)))
        return ("unknown" if rest < FEW * (high - low) else "differs"), 0, None, 0.0
    # The noise is in the recorded output, so the law is fitted to the command, not the reverse.
    dx, spread = x - x.mean(), float(np.std(x))
    rests, lines = [], []
    for _, late in LAWS:
        w = wanted[inner - late]
        slope = float(dx @ (w - w.mean()) / (dx @ dx))
        rests.append(float(np.std(w - slope * x)))
        lines.append((slope, float(w.mean() - slope * x.mean())))
    best = int(np.argmin(rests))
    if best > 0 and rests[best] > BETTER * rests[0]:
        best = 0
    (slope, offset), rest = lines[best], rests[best]
    total = slope**2 * spread**2 + rest**2
    explained = slope**2 * spread**2 / total if total > 0.0 else 0.0
    # To rounding the line is known better than by noise.
    share = TIGHT if 1.0 - explained < TIGHT**2 else LOOSE
    error = BEYOND * rest / (spread * float(np.sqrt(x.size)))
    is_law = abs(slope - 1.0) < share + error and abs(offset) < (share + error) * (high - low)
    if is_law and (explained > EXPLAINED or rest < WITHIN * noise):
        return ("approximate" if best == 0 else LAWS[best][0]), LAWS[best][1], None, rest
    line = None if slope == 0.0 else Line(1.0 / slope, -offset / slope, explained)
    return "differs", 0, line, rest


def command_findings(
    columns: Columns, rows: Rows, command: Command, loop: ControlLoop
) -> Iterator[Finding]:
    """What the command does to an estimate."""
    if columns.command is not None and np.array_equal(columns.command, columns.reference):
        yield Finding(
            "reference_is_command",
            "note",
            "the reference equals the command in every row, so the recording shows a plant "
            "without a controller",
            "a fit can use the response to the command, but not the closed loop",
        )
    elif command.law in ("late", "early"):
        late = command.law == "late"
        yield Finding(
            f"command_{command.law}",
            "warning",
            f"each command was computed from the row {'before' if late else 'after'} its own "
            f"row, so command and output were logged one row, {seconds(rows.row_time)}, apart",
            "without a correction, the estimated delay is up to one row too "
            f"{'short' if late else 'long'}",
        )
    elif command.law == "approximate":
        yield Finding(
            "command_approximate",
            "note",
            "the command is nearly the command of the controller. Either the controller used "
            "another output than the recorded output, or noise was added to the recording",
            "none on a fit to the logged command. A fit of the loop needs "
            "Waveform(noise='recording'), because the noise is only in the recording",
        )
    elif command.law == "differs" and _is_relay(columns.command):
        yield Finding(
            "relay",
            "note",
            "the command has only two values, so the controller is probably a relay",
            "a fit of the loop would be wrong. Use method='relay' or 'output_error'",
        )
        return
    elif command.law == "differs":
        other = _other_law(command.line, loop)
        yield other
        if other.severity == "refused":
            return
    if command.strays:
        yield Finding(
            "command_strays",
            "warning",
            f"in {command.strays} of {columns.time.size} rows the command differs from the "
            "command that the controller would give. Either the command was logged at another "
            "time, or it did not come from this controller",
            "in each such row the command may belong to the next or the previous row, "
            f"{seconds(rows.row_time)} away",
            rows.row_time * command.strays / columns.time.size,
        )
    yield from _limit_findings(columns, command, loop)


def _is_relay(command: Array | None) -> bool:
    """Whether a command is at its largest or smallest value on every row."""
    return command is not None and bool(
        np.all((command == command.min()) | (command == command.max()))
    )


def _other_law(line: Line | None, loop: ControlLoop) -> Finding:
    """A command that is not that of the controller: another sign, unit or gain, or unrelated."""
    loose = (
        "a fit of the loop would attribute the difference to the delay. A fit of the response "
        "to the logged command (method='output_error') does not depend on the controller"
    )
    if line is None or line.explained < EXPLAINED:
        part = (
            ""
            if line is None
            else (f", which explains {100.0 * line.explained:.0f} % of the command")
        )
        return Finding(
            "command_differs",
            "warning",
            f"the command is not Kp (reference - output){part}. The recording is from another "
            "controller, or has other columns, or its reference is not logged",
            loose,
            math.inf,
        )
    slope = line.slope
    size = abs(slope)
    for factor, units in FACTORS.items():
        for times in (factor, 1.0 / factor):
            if abs(size / times - 1.0) < LOOSE:
                return Finding(
                    "command_unit",
                    "refused",
                    f"the command is {slope:.4g} times Kp (reference - output). The "
                    f"units differ ({units}, or the reverse): divide the command by {slope:.4g}",
                    f"the gain would be wrong by a factor of {times:.4g}",
                )
    if slope < 0.0:
        return Finding(
            "command_sign",
            "refused",
            f"the command is {slope:.4g} times Kp (reference - output), so its sign is wrong: "
            "multiply either the command or both other columns by -1",
            "the gain would be negative, and no delay would fit",
        )
    Kp = loop.parameters["Kp"]
    if abs(slope - 1.0) < LOOSE:
        return Finding(
            "command_offset",
            "warning",
            f"the command is Kp (reference - output) {line.offset:+.3g}. Either a constant such "
            "as a trim was added, or the controller had another reference",
            loose,
            math.inf,
        )
    return Finding(
        "command_gain",
        "warning",
        f"the command is {slope:.4g} times Kp (reference - output), so the gain of the "
        f"controller was {slope * Kp:.4g} instead of Kp={Kp:g}",
        loose,
        math.inf,
    )


def _limit_findings(columns: Columns, command: Command, loop: ControlLoop) -> Iterator[Finding]:
    if columns.command is None:
        return
    largest, seen = float(np.max(np.abs(columns.command))), command.limit_seen
    step = decimal_step(columns.command)
    if loop.limit is not None and largest > (1.0 + ROUNDING) * loop.limit + 0.51 * step:
        yield Finding(
            "limit_exceeded",
            "refused",
            f"the command reaches {largest:.6g}, although limit={loop.limit:g}: give the limit "
            "of the controller, or record the command after its limit",
            "the model would contain a limit that the loop did not have, so the estimated "
            "delay would be too short",
        )
    elif seen is not None and (loop.limit is None or seen < (1.0 - 1e-3) * loop.limit - step):
        note = "no limit was given" if loop.limit is None else f"limit={loop.limit:g} was given"
        yield Finding(
            "limit_seen",
            "warning" if loop.limit is None else "refused",
            f"the command stops at {seen:.6g}, although the controller demands more, and "
            f"{note}: give limit={seen:.6g}",
            "a fit of the loop would attribute the slower response to the delay",
        )
