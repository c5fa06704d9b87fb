"""A loop of a firmware whose parameters are floating-point numbers: which names, which formula.

The controller of such a loop is u = scale (P e + I ∫ e dt + D d), in units of the International
System, with d the derivative of the error e or less that of the measurement y, behind a filter of
one pole.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from deadtime.loops import Controller, DerivativeFilter
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

#: Digits that are written, of the seven that a parameter of 32 bits holds. More: long numbers to
#: type; fewer: gains move by over 0.05 %.
DIGITS = 4

NO_FILTER = (
    "The design has no filter of the derivative, but the vehicle has one, so the loop has less "
    "phase than designed. Give the controller one_pole_filter(corner)."
)

NO_KICK = (
    "The firmware takes the derivative of the measurement. So load response and margins are as "
    "designed, but the derivative does not respond to a step of the set point."
)


@dataclass(frozen=True)
class FirmwareLoop:
    """The parameters of one loop.

    Attributes
    ----------
    proportional, integral, derivative, corner : str
        Names of parameters; empty where the firmware has none. `corner` is that of the
        derivative's filter, Hz.
    derivative_of : {"error", "measurement"}
        What the firmware takes the derivative of.
    scale : float
        Gain in SI units per unit of a parameter.
    overall : str
        A parameter that multiplies all gains; empty for none. It is written as 1.
    units : str
        Of the error and of the output.
    span : (float, float)
        Values of the proportional parameter that the firmware's documentation calls usual.
    note : str
        What else has to be known.
    """

    proportional: str
    integral: str = ""
    derivative: str = ""
    corner: str = ""
    derivative_of: Literal["error", "measurement"] = "error"
    scale: float = 1.0
    overall: str = ""
    units: str = ""
    span: tuple[float, float] = (0.0, math.inf)
    note: str = ""

    @property
    def names(self) -> dict[str, str]:
        """The parameters by what they are for."""
        every = {
            "overall": self.overall,
            "proportional": self.proportional,
            "integral": self.integral,
            "derivative": self.derivative,
            "corner": self.corner,
        }
        return {part: name for part, name in every.items() if name}


def written(
    controller: Controller, found: FirmwareLoop, form: str, loop: str, line: str, source: str
) -> Settings:
    """The parameters of a controller in this loop; `line` makes one line of name and value."""
    check(controller, found, form, loop)
    proportional, integral, derivative, smooth = parts_of(controller)
    gains = {"proportional": proportional, "integral": integral, "derivative": derivative}
    for part, gain in gains.items():
        if gain < 0.0:
            raise ValueError(
                f"the {part} gain is {gain:g}, but the gains of {form} are positive. Check the "
                "sign of the plant, or reverse the actuator in the configuration of the vehicle"
            )
    notes = _notes(controller, found)
    values = {found.overall: 1.0} if found.overall else {}
    values |= {
        found.names[part]: _typed(gain / found.scale)
        for part, gain in gains.items()
        if part in found.names
    }
    if derivative and smooth is not None:
        values[found.corner] = _typed(_corner(smooth, form))
    if not found.span[0] <= values[found.proportional] <= found.span[1]:
        notes.append(
            f"{found.proportional} = {values[found.proportional]:.{DIGITS}g} is outside of the "
            f"usual range in the firmware's documentation, {found.span[0]:g} to "
            f"{found.span[1]:g}."
        )
    typed = controller_of(values, found)
    return Settings(
        form,
        loop,
        values,
        tuple(
            line.format(name=name, value=f"{value:.{DIGITS}g}") for name, value in values.items()
        ),
        typed,
        rounding_of(controller, typed),
        tuple(notes),
        source,
    )


def check(controller: Controller, found: FirmwareLoop, form: str, loop: str) -> None:
    """Refuse a controller that this loop cannot have, whatever the sizes of its gains."""
    *gains, smooth = parts_of(controller)
    for part, gain in zip(("proportional", "integral", "derivative"), gains, strict=True):
        if gain and part not in found.names:
            raise ValueError(
                f"{type(controller).__name__}: the {loop} loop of {form} has no {part} gain. "
                f"Its gains are {', '.join(found.names.values())}"
            )
    refuse_feed_forward(controller, form)
    weight, derivative_weight = weights_of(controller)
    if weight != 1.0:
        raise ValueError(f"weight={weight:g}: {form} has no weight of the set point. Give weight=1")
    if gains[2] and derivative_weight != 1.0 and found.derivative_of == "error":
        raise ValueError(
            f"{type(controller).__name__}: the {loop} loop of {form} takes the derivative of "
            "the error, which jumps with a step of the set point. Use PD, or PID with "
            "derivative_weight=1"
        )
    if smooth is not None:
        _corner(smooth, form)


def _notes(controller: Controller, found: FirmwareLoop) -> list[str]:
    """What the firmware does otherwise than the controller."""
    notes = [found.note] if found.note else []
    _, _, derivative, smooth = parts_of(controller)
    if derivative and weights_of(controller)[1] and found.derivative_of == "measurement":
        notes.append(NO_KICK)
    if derivative and smooth is None:
        notes.append(NO_FILTER)
    return notes


def _corner(smooth: DerivativeFilter, form: str) -> float:
    corner = pole_of(smooth)
    if corner is None:
        raise ValueError(
            f"{smooth}: the derivative's filter of {form} has one pole, but this filter has "
            "two. Use one_pole_filter(corner)"
        )
    return corner


def controller_of(values: Mapping[str, float], found: FirmwareLoop) -> Controller:
    """The controller that the values of these parameters make."""
    if found.proportional not in values:
        names = ", ".join(values) or "none"
        raise ValueError(f"{found.proportional} is missing. The text contains {names}")
    gains = {part: values[name] for part, name in found.names.items() if name in values}
    for part, value in gains.items():
        if not math.isfinite(value):
            raise ValueError(f"{found.names[part]} = {value}: give a finite number")
    scale = found.scale * gains.get("overall", 1.0)
    proportional, integral, derivative = (
        scale * gains.get(part, 0.0) for part in ("proportional", "integral", "derivative")
    )
    corner = gains.get("corner", 0.0)
    smooth = one_pole_filter(corner) if derivative and corner > 0.0 else None
    on_measurement = found.derivative_of == "measurement"
    return controller_from(proportional, integral, derivative, smooth, on_measurement)


def _typed(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
