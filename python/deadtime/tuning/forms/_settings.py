"""`Settings`: gains as people type them, and what the typed values are as a controller."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.plain import plain_fields
from deadtime.loops import PD, PI, PID, PV, Controller, DerivativeFilter, P

#: How much faster than the first pole of a derivative's filter its second one is, at least, for
#: the filter to count as one of one pole with the delay of both. Larger: filters that a firmware
#: can run are refused; smaller: more of the phase at high frequencies is neglected.
FASTER = 10.0

#: The same of a filter that is made for one pole. Larger: a pole that makes simulations stiff;
#: smaller: more of the phase at high frequencies is changed.
MADE_FASTER = 20.0


@dataclass(frozen=True, eq=False, repr=False)
class Settings(ReadOnlyArrays):
    """Gains in a form that people type in; made by `settings_of`.

    Attributes
    ----------
    form : str
        ``"ideal"``, ``"series"``, ``"parallel"``, ``"ardupilot"``, ``"px4"`` or
        ``"betaflight"``.
    loop : str
        The loop of a firmware, such as ``"roll rate"``; empty for the other forms.
    values : dict of str to float
        The numbers by the names that they are typed under, rounded as they are typed.
    lines : tuple of str
        The same as lines that can be pasted.
    controller : Controller
        What the rounded values are.
    rounding : float
        Largest relative change of a gain by the rounding.
    notes : tuple of str
        What the form does otherwise than the controller, in sentences.
    source : str
        Where the formula stands.
    """

    form: str
    loop: str
    values: dict[str, float]
    lines: tuple[str, ...]
    controller: Controller
    rounding: float
    notes: tuple[str, ...]
    source: str

    def __repr__(self) -> str:
        return f"<Settings {self.form}: {'; '.join(self.lines)}>"

    def summary(self) -> str:
        """The lines to paste, what rounding changed, and notes.

        Returns
        -------
        str
        """
        share = 100.0 * self.rounding
        said = f"rounding changes no gain by more than {share:.2g} %"
        return "\n".join([*self.lines, f"({said}; {self.source})", *self.notes])

    def to_dict(self) -> dict[str, Any]:
        """The settings as plain values for JSON."""
        names = "form loop values lines rounding notes source"
        own = {name: getattr(self, name) for name in names.split()}
        return plain_fields({**own, "gains": self.controller.gains})


def rounding_of(before: Controller, after: Controller) -> float:
    """Largest relative change of a gain."""
    own, typed = parts_of(before), parts_of(after)
    pairs = zip(own[:3], typed[:3], strict=True)
    return max(abs(new - old) / abs(old) for old, new in pairs if old)


def parts_of(controller: Controller) -> tuple[float, float, float, DerivativeFilter | None]:
    """Proportional, integral and derivative gain, and the filter of the derivative."""
    gains = controller.gains
    derivative = gains.get("Kd", 0.0) or gains.get("Kv", 0.0)
    smooth = getattr(controller, "filter", None)
    return gains["Kp"], gains.get("Ki", 0.0), derivative, smooth


def controller_from(
    proportional: float,
    integral: float,
    derivative: float,
    smooth: DerivativeFilter | None = None,
    on_measurement: bool = False,
    **weights: float,
) -> Controller:
    """The simplest controller with these gains; weights are those of PD, PI and PID."""
    if derivative == 0.0:
        if integral == 0.0:
            return P(proportional)
        return PI(proportional, integral, **weights)
    if integral != 0.0:
        if on_measurement:
            weights["derivative_weight"] = 0.0
        return PID(proportional, integral, derivative, smooth, **weights)
    if on_measurement:
        return PV(proportional, derivative, smooth)
    weights.pop("anti_windup", None)
    return PD(proportional, derivative, smooth, **weights)


def weights_of(controller: Controller) -> tuple[float, float]:
    """Weights of the set point in the proportional term and in the derivative."""
    numbers = controller.parameters
    derivative = 0.0 if isinstance(controller, PV) else numbers.get("derivative_weight", 1.0)
    return numbers.get("weight", 1.0), derivative


def refuse_feed_forward(controller: Controller, form: str) -> None:
    """Refuse a gain of the set point past the controller, which is not written."""
    gain = controller.parameters.get("feed_forward", 0.0)
    if gain:
        raise ValueError(
            f"feed_forward={gain:g}: settings of {form} are written without feed-forward. "
            "Leave feed_forward out"
        )


def one_pole_filter(corner: float) -> DerivativeFilter:
    """Return a filter of the derivative that acts as one pole, as most firmware has it.

    Parameters
    ----------
    corner : float
        Corner of the pole, Hz.

    Returns
    -------
    DerivativeFilter
        With two poles, one 20 times faster than the other, and the delay of the one pole.

    Raises
    ------
    ValueError
        If the corner is not above zero.

    Examples
    --------
    >>> from deadtime.tuning import one_pole_filter
    >>> smooth = one_pole_filter(20.0)
    >>> round(smooth.omega, 1), round(smooth.damping, 3)
    (590.1, 2.348)
    """
    if not (math.isfinite(corner) and corner > 0.0):
        raise ValueError(f"corner={corner!r}: give a frequency in Hz, above zero")
    damping = 0.5 * (1.0 + MADE_FASTER) / math.sqrt(MADE_FASTER)
    return DerivativeFilter(2.0 * damping * 2.0 * math.pi * corner, damping)


def pole_of(smooth: DerivativeFilter) -> float | None:
    """The corner of a filter of one pole, Hz; None for a filter that has two.

    The delay of both poles together, 2 damping/omega, is that of the one.
    """
    if smooth.damping <= 1.0:
        return None
    root = math.sqrt(smooth.damping**2 - 1.0)
    if smooth.damping + root < FASTER * (smooth.damping - root):
        return None
    return smooth.omega / (4.0 * math.pi * smooth.damping)


def numbers_from(given: Mapping[str, float] | str, form: str, pattern: Any) -> dict[str, float]:
    """Values by name, from a mapping or from lines of text; lines of another kind are skipped."""
    if isinstance(given, Mapping):
        return {str(name): float(value) for name, value in given.items()}
    found = {}
    for name, value in pattern.findall(given):
        try:
            found[name] = float(value)
        except ValueError:
            continue
    if not found:
        raise ValueError(f"no line of the text belongs to the form {form!r}: {given[:60]!r}")
    return found
