r"""The rate loops of Betaflight: whole numbers P, I and D, with a scale each.

    u = PTERM_SCALE P e + ITERM_SCALE I ∫ e dt - DTERM_SCALE D dω/dt

with e and ω in deg/s, and u in thousandths of the motors' full range (`PID_MIXER_SCALING`), as the
Blackbox logs it. ITERM_SCALE counts 2.5 times on yaw. The derivative is that of the gyroscope,
behind `dterm_lpf1` and `dterm_lpf2`; a PT2 is two poles at :math:`1/\sqrt{\sqrt 2 - 1}` times its
corner, a BIQUAD one of Butterworth. FEEDFORWARD_SCALE F/100 times the derivative of the set point
comes on top: with an F of the same gain as D the derivative is that of the error.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from deadtime.loops import Controller, DerivativeFilter
from deadtime.tuning.forms._firmware import NO_FILTER
from deadtime.tuning.forms._settings import (
    Settings,
    controller_from,
    one_pole_filter,
    parts_of,
    pole_of,
    refuse_feed_forward,
    rounding_of,
    weights_of,
)

SOURCE = "Betaflight 4.3 to 2025.12: src/main/flight/pid.h, pid_init.c, pid.c and common/filter.c"

#: Gain in thousandths of full range per deg/s, per degree and per deg/s², for a P, I or D of one,
#: and per deg/s² of the set point for an F of 100.
PTERM_SCALE, ITERM_SCALE, DTERM_SCALE, FEEDFORWARD_SCALE = 0.032029, 0.244381, 0.000529, 0.013754

#: How many times I counts on yaw, without integrated yaw.
YAW_INTEGRAL = 2.5

#: Largest P, I or D, and F: PID_GAIN_MAX and F_GAIN_MAX.
LARGEST, LARGEST_F = 250, 1000

DEGREES = 180.0 / math.pi

#: Gain of an F of one, in thousandths of full range per rad/s² of the set point.
FEEDFORWARD = DEGREES * 0.01 * FEEDFORWARD_SCALE

#: How far a damping ratio may be from that of a PT2 or of a BIQUAD, as a share. Larger: another
#: filter is written than was designed; smaller: rounding refuses filters.
SAME_DAMPING = 1e-3

#: Largest share by which rounding to whole numbers may change a gain before a note says so.
COARSE = 0.02

#: A line of the command line, such as ``set p_roll = 45``.
LINE = re.compile(r"^\s*set\s+(\w+)\s*=\s*(\S+)", re.M)

#: Types of low-pass filters, as the head of a Blackbox log counts them.
PT1, BIQUAD, PT2, PT3 = 0, 1, 2, 3
TYPES = {"PT1": PT1, "BIQUAD": BIQUAD, "PT2": PT2, "PT3": PT3}

#: The first firmware whose D is that of calm flight and d_max its largest; before, d_min was the
#: one and D the largest.
D_MAX = (4, 6)

LOOPS = ("roll rate", "pitch rate", "yaw rate")

NOTES = (
    "TPA lowers the gains above tpa_breakpoint; iterm_relax holds I while the set point moves.",
    "The lines switch off the sliders and the dynamic damping, because both would change "
    "the gains.",
)

KEPT_F = (
    "F does not change, because it acts on the derivative of the set point, outside of the loop."
)

#: How far the gain of F may be from that of D where both make the derivative of the error, in units
#: of a whole number of both.
SAME_F = 1.0


def pole_in_row(number: int, corner: float) -> float:
    """Pole of equal poles in a row whose corner together, at -3 dB, is `corner`."""
    return corner / math.sqrt(2.0 ** (1.0 / number) - 1.0)


def scales(loop: str) -> tuple[float, float, float]:
    """Gains per unit of P, I and D, in thousandths of full range per rad/s, rad and rad/s²."""
    integral = ITERM_SCALE * (YAW_INTEGRAL if loop == "yaw rate" else 1.0)
    return DEGREES * PTERM_SCALE, DEGREES * integral, DEGREES * DTERM_SCALE


def write(controller: Controller, loop: str, version: tuple[int, ...] | None) -> Settings:
    """The lines of the command line for a rate loop."""
    axis = loop.removesuffix(" rate")
    gains = parts_of(controller)[:3]
    smooth = parts_of(controller)[3]
    values = {}
    for letter, gain, scale in zip("pid", gains, scales(loop), strict=True):
        values[f"{letter}_{axis}"] = _whole(f"{letter}_{axis}", gain, scale, LARGEST)
    notes = list(NOTES)
    check(controller)
    weighted = gains[2] * weights_of(controller)[1]
    if weighted:
        values[f"f_{axis}"] = _whole(f"f_{axis}", weighted, FEEDFORWARD, LARGEST_F)
    else:
        notes.append(KEPT_F)
    lines = [f"set {name} = {value:.0f}" for name, value in values.items()]
    peak = "d_max" if version is not None and version >= D_MAX else "d_min"
    lines.append(f"set {peak}_{axis} = {values[f'd_{axis}']:.0f}")
    if gains[2] and smooth is None:
        notes.append(NO_FILTER)
    elif gains[2] and smooth is not None:
        kind, corner = _low_pass(smooth)
        values |= {"dterm_lpf1_type": float(TYPES[kind]), "dterm_lpf1_static_hz": corner}
        lines += [
            f"set dterm_lpf1_type = {kind}",
            f"set dterm_lpf1_static_hz = {corner:.0f}",
            "set dterm_lpf1_dyn_min_hz = 0",
            "set dterm_lpf2_static_hz = 0",
        ]
    lines += ["set simplified_pids_mode = OFF", "save"]
    typed = read("\n".join(lines), loop)
    rounding = rounding_of(controller, typed)
    if rounding > COARSE:
        notes.append(f"Betaflight has only whole numbers, so a gain changes by {rounding:.1%}.")
    return Settings("betaflight", loop, values, tuple(lines), typed, rounding, tuple(notes), SOURCE)


def check(controller: Controller) -> None:
    """Refuse a filter, a weight or a feed-forward that the firmware lacks."""
    refuse_feed_forward(controller, "betaflight")
    weight = weights_of(controller)[0]
    if weight != 1.0:
        raise ValueError(f"weight={weight:g}: Betaflight has no weight of P. Give weight=1")
    smooth = parts_of(controller)[3]
    if smooth is not None:
        _low_pass(smooth)


def read(given: Mapping[str, float] | str, loop: str) -> Controller:
    """The controller of settings or of lines of the command line."""
    axis = loop.removesuffix(" rate")
    if isinstance(given, str):
        settings = dict(LINE.findall(given))
    else:
        settings = _of_head({name: str(value) for name, value in given.items()}, axis)
    if f"p_{axis}" not in settings:
        raise ValueError(f"p_{axis} is missing. The text contains {', '.join(settings) or 'none'}")
    proportional, integral, derivative = (
        _setting(settings, f"{letter}_{axis}") * scale
        for letter, scale in zip("pid", scales(loop), strict=True)
    )
    if derivative:
        _check_constant(settings, axis)
    smooth = _filter_of(settings) if derivative else None
    of_set_point = _setting(settings, f"f_{axis}") * FEEDFORWARD
    of_error = abs(derivative - of_set_point) <= SAME_F * max(FEEDFORWARD, scales(loop)[2])
    weights = {}
    if integral and derivative and of_set_point and not of_error:
        weights["derivative_weight"] = of_set_point / derivative
    on_measurement = not (of_error or weights)
    return controller_from(proportional, integral, derivative, smooth, on_measurement, **weights)


def _of_head(settings: dict[str, str], axis: str) -> dict[str, str]:
    """The values of a log's head under the names of the command line, where it is one."""
    place = ("roll", "pitch", "yaw").index(axis)
    renamed = {f"{axis}PID[{k}]": f"{letter}_{axis}" for k, letter in enumerate("pid")}
    renamed |= {f"{peak}[{place}]": f"{peak}_{axis}" for peak in ("d_min", "d_max")}
    renamed |= {
        f"ff_weight[{place}]": f"f_{axis}",
        "dterm_lpf1_dyn_hz[0]": "dterm_lpf1_dyn_min_hz",
    }
    return settings | {name: settings[head] for head, name in renamed.items() if head in settings}


def _check_constant(settings: Mapping[str, str], axis: str) -> None:
    """Refuse a D that moves during the flight: d_min until 4.5, d_max since 4.6."""
    own = _setting(settings, f"d_{axis}")
    least, most = (_setting(settings, f"{peak}_{axis}") for peak in ("d_min", "d_max"))
    if 0.0 < least < own or most > own:
        ends = (least, own) if 0.0 < least < own else (own, most)
        raise ValueError(
            f"d_{axis} moves between {ends[0]:g} and {ends[1]:g} in flight, so it is not one "
            "gain: set both to the same number"
        )


def _whole(name: str, gain: float, scale: float, largest: int) -> float:
    """The whole number of a gain, refused where there is none."""
    value = gain / scale
    if not 0.0 <= value <= largest + 0.5:
        raise ValueError(
            f"{name} = {value:.1f}: Betaflight needs a whole number from 0 to {largest}"
        )
    if gain and value < 0.5:
        raise ValueError(
            f"{name} = {value:.2g} would be rounded to zero, because Betaflight has only whole "
            "numbers. Design without this gain"
        )
    return float(min(round(value), largest))


def _low_pass(smooth: DerivativeFilter) -> tuple[str, float]:
    """Type and corner of the low-pass filter, Hz."""
    if (corner := pole_of(smooth)) is not None:
        return "PT1", float(round(corner))
    hertz = smooth.omega / (2.0 * math.pi)
    kinds = (("PT2", 1.0, pole_in_row(2, 1.0)), ("BIQUAD", math.sqrt(0.5), 1.0))
    for kind, damping, factor in kinds:
        if abs(smooth.damping - damping) <= SAME_DAMPING * damping:
            return kind, float(round(hertz / factor))
    raise ValueError(
        f"{smooth}: this filter does not exist in Betaflight. Its filters of D are PT1 (one "
        "pole), PT2 (a damping ratio of 1) and BIQUAD (0.7071)"
    )


def _filter_of(settings: Mapping[str, str]) -> DerivativeFilter | None:
    corners = [_setting(settings, f"dterm_lpf{k}_static_hz") for k in (1, 2)]
    used = [k + 1 for k, corner in enumerate(corners) if corner > 0.0]
    if not used:
        return None
    if len(used) == 2:
        raise ValueError(
            f"dterm_lpf1_static_hz = {corners[0]:g}, dterm_lpf2_static_hz = {corners[1]:g}: the "
            "controllers here have only one filter of D. Set one of the two to 0"
        )
    if _setting(settings, "dterm_lpf1_dyn_min_hz") > 0.0:
        raise ValueError(
            "dterm_lpf1_dyn_min_hz is above 0, so the corner changes with the throttle. Set "
            "this parameter to 0"
        )
    name = f"dterm_lpf{used[0]}_type"
    text = settings.get(name, "PT1")
    corner, kind = corners[used[0] - 1], TYPES[text] if text in TYPES else _setting(settings, name)
    if kind == PT1:
        return one_pole_filter(corner)
    if kind == PT2:
        return DerivativeFilter(2.0 * math.pi * pole_in_row(2, corner), damping=1.0)
    if kind == BIQUAD:
        return DerivativeFilter(2.0 * math.pi * corner, damping=math.sqrt(0.5))
    raise ValueError(f"{name} = {text}: give one of PT1, PT2 and BIQUAD")


def _setting(settings: Mapping[str, str], name: str) -> float:
    """A number of zero or more; zero for one that is not there."""
    text = settings.get(name, "0")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value < 0.0:
        raise ValueError(f"{name} = {text}: give a number of zero or more")
    return value
