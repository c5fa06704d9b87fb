"""The three forms of textbooks and process controllers: ideal, series, parallel.

    ideal       u = Kc (1 + 1/(Ti s) + Td s) e
    series      u = Kc (1 + 1/(Ti s)) (1 + Td s) e
    parallel    u = (Kp + Ki/s + Kd s) e

(Åström and Hägglund 2006, section 3.2.) With K', Ti' and Td' those of the series form, the ideal
one has K = K' (Ti' + Td')/Ti', Ti = Ti' + Td', Td = Ti' Td'/(Ti' + Td'). The way back takes the
root of 1 - 4 Td/Ti, so that a series form exists for Ti >= 4 Td only. A proportional band in % is
100/|Kc| in units of the spans of measurement and output.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from deadtime._base.validation import finite
from deadtime.loops import PV, BackCalculation, Controller
from deadtime.tuning.forms._settings import (
    Settings,
    controller_from,
    numbers_from,
    one_pole_filter,
    parts_of,
    pole_of,
    refuse_feed_forward,
    rounding_of,
)

#: Digits that are typed. More: long numbers on a faceplate; fewer: gains move by over 0.05 %.
DIGITS = 4

SOURCE = "Åström and Hägglund 2006, section 3.2"

#: A line such as ``Ti = 40 s``, and what stands behind its sign.
LINE = re.compile(r"^\s*(\w+)\s*[=:]\s*(.*?)\s*$", re.M)
VALUE = re.compile(r"([-+0-9.eE]+|off)\s*(s|%|)", re.I)

#: What the weights of the set point and the time of back-calculation are called.
WEIGHTS = {"weight": "b", "derivative_weight": "c", "tracking_time": "Tt"}

#: Name of the number for an integral or a derivative that is switched off, and a filter's time.
OFF, FILTER = "off", "Tf"


@dataclass(frozen=True)
class _Times:
    """A gain, an integral time in s, infinite for none, and a derivative time in s."""

    Kc: float
    Ti: float = math.inf
    Td: float = 0.0

    def __post_init__(self) -> None:
        finite("Kc", self.Kc)
        finite("Td", self.Td)
        if math.isnan(self.Ti) or self.Ti == 0.0:
            raise ValueError(
                f"Ti={self.Ti}: give an integral time other than zero, or inf for no integral"
            )

    def controller(self) -> Controller:
        """The controller with these numbers.

        Returns
        -------
        Controller
        """
        factor = self._factor()
        return controller_from(self.Kc * factor, self.Kc / self.Ti, self.Kc * self.Td)

    def _factor(self) -> float:
        """The proportional gain by Kc."""
        return 1.0


@dataclass(frozen=True)
class IdealForm(_Times):
    """The ideal form, also called standard or non-interacting: u = Kc (1 + 1/(Ti s) + Td s) e.

    Parameters
    ----------
    Kc : float
        Gain.
    Ti : float
        Integral time, s; infinite for none.
    Td : float
        Derivative time, s.

    Examples
    --------
    >>> from deadtime.tuning import IdealForm
    >>> IdealForm(Kc=2.0, Ti=8.0, Td=1.0).controller()
    PID(Kp=2.0, Ki=0.25, Kd=2.0, filter=None)
    """

    @classmethod
    def of(cls, controller: Controller) -> IdealForm:
        """The ideal form of a controller.

        Parameters
        ----------
        controller : Controller

        Returns
        -------
        IdealForm

        Raises
        ------
        ValueError
            If its proportional gain is zero, which the form cannot express.
        """
        proportional, integral, derivative, _ = parts_of(controller)
        if proportional == 0.0:
            raise ValueError(
                f"{controller}: without a proportional gain there is no ideal form. Use the "
                "form parallel"
            )
        times = proportional / integral if integral else math.inf
        return cls(proportional, times, derivative / proportional)


@dataclass(frozen=True)
class SeriesForm(_Times):
    """The series form, also called interacting: u = Kc (1 + 1/(Ti s)) (1 + Td s) e.

    Parameters
    ----------
    Kc : float
        Gain.
    Ti : float
        Integral time, s; infinite for none.
    Td : float
        Derivative time, s.

    Examples
    --------
    >>> from deadtime.tuning import IdealForm, SeriesForm
    >>> series = SeriesForm(Kc=1.0, Ti=4.0, Td=4.0)
    >>> IdealForm.of(series.controller())
    IdealForm(Kc=2.0, Ti=8.0, Td=2.0)
    """

    def _factor(self) -> float:
        return 1.0 + self.Td / self.Ti

    @classmethod
    def of(cls, controller: Controller) -> SeriesForm:
        """The series form of a controller.

        Parameters
        ----------
        controller : Controller

        Returns
        -------
        SeriesForm

        Raises
        ------
        ValueError
            If it has none, because its integral time is below four derivative times.
        """
        ideal = IdealForm.of(controller)
        if math.isinf(ideal.Ti):
            return cls(ideal.Kc, ideal.Ti, ideal.Td)
        if ideal.Ti * ideal.Td < 0.0 or ideal.Ti < 4.0 * ideal.Td * (1.0 - 1e-12):
            raise ValueError(
                f"Ti = {ideal.Ti:.4g} s and Td = {ideal.Td:.4g} s: the series form has only "
                "real zeros, so it needs Ti >= 4 Td. Use the form ideal or parallel"
            )
        root = math.sqrt(max(1.0 - 4.0 * ideal.Td / ideal.Ti, 0.0))
        # The smaller root by the product of both, which does not cancel.
        slow = 0.5 * ideal.Ti * (1.0 + root)
        return cls(0.5 * ideal.Kc * (1.0 + root), slow, ideal.Td * ideal.Ti / slow)


@dataclass(frozen=True)
class ParallelForm:
    """The parallel form: u = (Kp + Ki/s + Kd s) e.

    Parameters
    ----------
    Kp, Ki, Kd : float
        Gains.

    Examples
    --------
    >>> import deadtime as dtm
    >>> from deadtime.tuning import ParallelForm
    >>> ParallelForm.of(dtm.PI(Kp=2.0, Ki=0.5))
    ParallelForm(Kp=2.0, Ki=0.5, Kd=0.0)
    """

    Kp: float
    Ki: float = 0.0
    Kd: float = 0.0

    def controller(self) -> Controller:
        """The controller with these numbers.

        Returns
        -------
        Controller
        """
        return controller_from(self.Kp, self.Ki, self.Kd)

    @classmethod
    def of(cls, controller: Controller) -> ParallelForm:
        """The parallel form of a controller.

        Parameters
        ----------
        controller : Controller

        Returns
        -------
        ParallelForm
        """
        return cls(*parts_of(controller)[:3])


def proportional_band(gain: float, spans: tuple[float, float]) -> float:
    """Return the proportional band of a gain, %.

    Parameters
    ----------
    gain : float
        In units of the output by those of the measurement.
    spans : (float, float)
        Span of the measurement and of the output, each in its own unit.

    Returns
    -------
    float
        Share of the measurement's span over which the output moves over its whole span.

    Raises
    ------
    ValueError
        If a span is not above zero, or the gain is zero.

    Examples
    --------
    >>> from deadtime.tuning import proportional_band
    >>> proportional_band(0.5, (200.0, 100.0))
    100.0
    """
    measured, given = (finite("a span", span) for span in spans)
    if min(measured, given) <= 0.0 or gain == 0.0:
        raise ValueError(
            f"gain={gain:g}, spans={spans}: give spans above zero, and a gain that is not zero"
        )
    return 100.0 * given / (abs(gain) * measured)


FORMS: dict[str, type[IdealForm] | type[SeriesForm] | type[ParallelForm]] = {
    "ideal": IdealForm,
    "series": SeriesForm,
    "parallel": ParallelForm,
}


def write(controller: Controller, form: str, spans: tuple[float, float] | None) -> Settings:
    """The numbers of one of the forms."""
    found = FORMS[form].of(controller)
    refuse_feed_forward(controller, form)
    values = {name: _typed(value) for name, value in vars(found).items()}
    values |= {
        WEIGHTS[name]: _typed(value)
        for name, value in controller.parameters.items()
        if name in WEIGHTS and (value != 1.0 or name == "tracking_time")
    }
    lines = [f"{name} = {_shown(name, value)}" for name, value in values.items()]
    notes = []
    if "b" in values:
        notes.append(
            "b is the weight of the set point in the proportional term. If your controller has "
            "no b, a step of the set point overshoots more. To avoid this, design with "
            "weight=1."
        )
    smooth = parts_of(controller)[3]
    if smooth is not None:
        corner = pole_of(smooth)
        if corner is None:
            raise ValueError(
                f"{smooth}: in a process controller the filter has one pole, but this filter "
                "has two. Use one_pole_filter(corner)"
            )
        values[FILTER] = _typed(0.5 / (math.pi * corner))
        lines.append(f"{FILTER} = {values[FILTER]:.{DIGITS}g} s")
    if isinstance(controller, PV):
        notes.append(
            "The derivative acts on the measurement: switch off the derivative of the set point."
        )
    if values.get("Kc", values.get("Kp", 0.0)) < 0.0:
        notes.append(
            "The gain is negative, so set the controller to direct action: its output rises "
            "with the measurement."
        )
    typed = read(values, form, isinstance(controller, PV))
    if spans is not None:
        band = proportional_band(parts_of(typed)[0] if form == "parallel" else values["Kc"], spans)
        lines.append(f"PB = {band:.{DIGITS}g} %")
        notes.append(
            f"The proportional band applies to a span of {spans[0]:g} for the measurement and "
            f"{spans[1]:g} for the output."
        )
    rounding = rounding_of(controller, typed)
    return Settings(form, "", values, tuple(lines), typed, rounding, tuple(notes), SOURCE)


def read(given: Mapping[str, float] | str, form: str, on_measurement: bool = False) -> Controller:
    """The controller of typed numbers."""
    values = _numbers(given, form) if isinstance(given, str) else numbers_from(given, form, LINE)
    kind = FORMS[form]
    names = kind.__dataclass_fields__
    unknown = [name for name in values if name not in (*names, *WEIGHTS.values(), FILTER, "PB")]
    if unknown:
        raise ValueError(
            f"{unknown[0]!r} is not a parameter of the form {form!r}. Its parameters are "
            f"{', '.join(names)}"
        )
    own = {name: value for name, value in values.items() if name in names}
    if next(iter(names)) not in own:
        raise ValueError(f"{next(iter(names))} is missing from {own}")
    time = values.get(FILTER, 0.0)
    smooth = one_pole_filter(0.5 / (math.pi * time)) if time else None
    parts = parts_of(kind(**own).controller())
    weights: Any = {name: values[short] for name, short in WEIGHTS.items() if short in values}
    if "tracking_time" in weights:
        weights["anti_windup"] = BackCalculation(weights.pop("tracking_time"))
    made = controller_from(*parts[:3], smooth if parts[2] else None, on_measurement, **weights)
    for name, short in WEIGHTS.items():
        if short in values and name not in made.parameters:
            raise ValueError(
                f"{short} = {values[short]:g}: a {type(made).__name__} has no {short}. Leave "
                "this parameter out"
            )
    return made


def _numbers(text: str, form: str) -> dict[str, float]:
    """Values by name of lines of text; other lines are skipped, and what is no number refused."""
    found = {}
    for name, entry in LINE.findall(text):
        match = VALUE.fullmatch(entry)
        try:
            if match is None:
                raise ValueError
            value, unit = match[1].lower(), match[2]
            off = math.inf if name == "Ti" else 0.0
            found[name] = off if value == OFF else float(value)
        except ValueError:
            raise ValueError(
                f"{name} = {entry}: give one number in each line, with times in seconds, such "
                f"as {name} = 40.5"
            ) from None
        if (unit == "%") != (name == "PB") and unit:
            raise ValueError(
                f"{name} = {entry}: give {name} in another unit, because {unit} is not possible"
            )
    if not found:
        raise ValueError(f"no line of the text belongs to the form {form!r}: {text[:60]!r}")
    return found


def _typed(value: float) -> float:
    return float(f"{value:.{DIGITS}g}") + 0.0  # no -0


def _shown(name: str, value: float) -> str:
    if math.isinf(value):
        return OFF
    return f"{value:.{DIGITS}g}{' s' if name.startswith('T') else ''}"
