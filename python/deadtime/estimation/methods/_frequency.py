"""Maximum likelihood in the frequency domain (Pintelon & Schoukens 2012, chapters 8 to 12).

Periodic excitation (`period`): means of the DFT of each period at the lines that the reference
excites are the responses to it, and covariances between the periods are the noise on both, with the
feedback: the reference is the instrument. With the response G(z) = gain H(z; delay, lag) of the
held plant, exact for every delay, errors in variables are fitted by

    cost = sum |Y - G U|²/(s_y² + |G|² s_u² - 2 Re(s_yu G*));

twice its minimum is chi-square where the model holds, which is tested; otherwise the errors are
widened.

One record without a period: the lines of the DFT of y - gain F(t - Td), F the exact response to
the held commands from the beginning on, so that there is no leakage by a transient; the mean, and
with it the initial output, is left out. White noise is white over the lines; all of them are output
error (Parseval).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, TypeAlias

import numpy as np

import deadtime.estimation._least_squares as least_squares
import deadtime.estimation.data._checks as checks
from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import positive, whole_number
from deadtime._base.verdicts import verdict_if
from deadtime.estimation._native import LEVEL_OF_TESTS, HeldResponse, LinesMisfit
from deadtime.estimation._result import ADVICE, REASONS
from deadtime.estimation.data._simulated import commands_over_samples
from deadtime.estimation.methods._method import OfOne, Read, Run, is_rounding
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

#: The rows, what is fitted, no initial output, and what is known.
_Asked: TypeAlias = tuple[Recording, tuple[str, ...], float, Mapping[str, float]]

#: Longest delay of the search, as a share of the record or of the periods.
LONGEST = 0.6

#: Why there is no interval for a continuous loop.
NOT_HELD = (
    "the frequency method assumes that the command is constant between samples. The command "
    "of a continuous loop is not. Use method='waveform' for an interval"
)

#: Most points of the initial grid over the delay, one for each sample if they are fewer.
MOST_POINTS = 400

#: A line of the reference counts as excited above this share of the largest line.
EXCITED = 1e-3

#: Lines to either side over which the kernel averages covariances.
NEIGHBOURS = 1

#: Largest deviation of a period from a whole number of samples, in samples.
WHOLE = 1e-3

#: Largest relative deviation of the time between samples from its median.
EVEN = 1e-3


@dataclass(frozen=True)
class Frequency(OfOne):
    """Maximum likelihood at the lines of a spectrum, for periodic experiments.

    Parameters
    ----------
    period : float, optional
        Period of the excitation in s, a whole number of samples. Without one, all lines of the
        window are used.
    left_out : int
        Periods at the beginning that are left out as transient.
    highest : float, optional
        Highest frequency that is used, Hz; all of them if not given.

    Raises
    ------
    ValueError
        When the period or the frequency is not above zero, or `left_out` is negative.
    """

    period: float | None = None
    left_out: int = 1
    highest: float | None = None

    name: ClassVar[str] = "frequency"

    def __post_init__(self) -> None:
        for name, value in (("period", self.period), ("highest", self.highest)):
            if value is not None:
                positive(name, value)
        whole_number("left_out", self.left_out, least=0)

    def names(self, free: Sequence[str], loop: ControlLoop) -> tuple[str, ...]:
        """The numbers that are asked for."""
        return checks.checked_names(free, loop)

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        from scipy import special

        recording, loop, window, *_ = run
        checks.integrator_of(loop, "frequency")
        data, rows = recording.window(*window), recording.rows(*window)
        checks.check_even(
            data, EVEN, "a DFT needs evenly spaced samples. Use method='output_error'"
        )
        command, source = commands_over_samples(recording, loop)
        commands = recording.time[: rows.stop], command[: rows.stop]
        checks.check_moves(data.output, command[rows])
        top = math.inf if self.highest is None else self.highest
        known = {**loop.parameters, "delay": 0.0 if loop.delay is None else loop.delay}
        asked = data, names, 0.0, known
        if self.period is None:
            lines = _record_lines(asked, commands, top)
        else:
            reference = _whole_periods(data, self.period, self.left_out)
            lines = _periodic_lines(asked, command[rows], reference, self.period, top)
        fit = lines.fit()
        values = lines.values(fit.point)
        loose = [i for i, name in enumerate(names) if name != "lag" or values["lag"] > 0.0]
        jacobian = fit.jacobian[:, loose]
        checks.check_distinguishable(jacobian, [names[i] for i in loose])
        scale = fit.cost / lines.freedom
        p_value, wider = 1.0, scale
        if lines.known_noise:
            p_value = float(special.chdtrc(lines.freedom, fit.cost / lines.widening))
            wider = max(lines.widening, scale)
        cov = np.zeros((len(names), len(names)))
        cov[np.ix_(loose, loose)] = wider * np.linalg.inv(jacobian.T @ jacobian)
        errors = checks.standard_errors(names, cov)
        checks.check_gain(values, errors)
        found = {**known, **values}
        residuals = _residuals(data, HeldResponse(*commands), found)
        whiteness = least_squares.whiteness_of(residuals, len(names))
        white = p_value > LEVEL_OF_TESTS if lines.known_noise else whiteness.white
        reliable = white or is_rounding(residuals, data)
        return Read(
            values,
            cov,
            start=float(data.output[0]),
            recording=data,
            residuals=residuals,
            verdict=verdict_if(reliable),
            message=_message(names, lines, source, reliable),
            uncalibrated="" if loop.is_sampled else NOT_HELD,
            details={"lines": lines.describe, "command": source, "p_value_of_model": p_value},
            profile=least_squares.Profile(
                cost=partial(least_squares.least_cost, lines, fit, known),
                best=fit.cost,
                freedom=lines.freedom,
                widening=dict.fromkeys(errors, math.sqrt(wider / scale) if scale > 0.0 else 1.0),
                preferred="delay and lag have similar effects" if "lag" in names else "",
            ),
        )


@dataclass(frozen=True, eq=False)
class _Lines(least_squares.ModelOfOne):
    """The misfit at lines of a spectrum, over its standard deviation where that is known.

    `made` makes it of the numbers.
    """

    known: Mapping[str, float]
    made: Callable[[Any], LinesMisfit]
    known_noise: bool
    freedom: int
    widening: float
    longest: float
    describe: str

    @property
    def kernel(self) -> LinesMisfit:
        """The misfit of the kernel."""
        return self.made((self.names, self.known, self.recording.sample_time))

    def ends(self, label: str) -> least_squares.Ends:
        """Bounds and starting values of one of the parameters."""
        if label == "gain":
            return least_squares.Ends(-math.inf, math.inf, [self.known["gain"]])
        return least_squares.Ends(0.0, math.inf, [self.recording.sample_time])

    def fit(self) -> least_squares.Minimum:
        """The parameters of least cost; a lag that does not reduce it is zero."""
        row = self.recording.sample_time
        if "delay" not in self.names:
            return self.problem.without_vanishing(self.problem.solve(), 0.0)
        count = int(min(MOST_POINTS, max(2.0, self.longest / row)))
        grid = np.linspace(0.0, self.longest, count + 1)
        guess = np.array([self.known["gain"] if name == "gain" else row for name in self.names])
        costs, _, found = self.problem.scan(grid, guess, 0.0)
        if int(np.argmin(costs)) == count:
            raise NotIdentifiableError(
                f"the search ends at its longest delay, {grid[-1]:.3g} s, so the "
                "output is not a response to this command. Check columns and units"
            )
        return found


def _record_lines(asked: _Asked, commands: tuple[Array, Array], highest: float) -> _Lines:
    """Lines of one record without the mean; white noise has the same size at each."""
    data, names, *_ = asked
    size = len(data)
    count = int(np.sum(np.fft.rfftfreq(size, data.sample_time)[1:] <= highest))
    every = count == size // 2
    real = 2 * count - (every and size % 2 == 0)
    if real < 2 * (len(names) + 1):
        raise NotIdentifiableError(
            f"{count} lines of the spectrum up to {highest:g} Hz are too few to "
            f"fit {len(names)} parameters: choose a longer window, or give a higher `highest`"
        )
    last = None if every else count
    made = partial(
        LinesMisfit.of_record, commands=commands, time=data.time, output=data.output, last=last
    )
    longest = LONGEST * float(data.time[-1] - data.time[0])
    freedom = real - len(names)
    return _Lines(*asked, made, False, freedom, 1.0, longest, f"{count} of one record")


def _whole_periods(data: Recording, period: float, left_out: int) -> Array:
    """The reference in the whole periods after the first `left_out`, a row each."""
    h = data.sample_time
    samples = round(period / h)
    if abs(period / h - samples) > WHOLE or samples < 4:
        raise ValueError(
            f"period={period:g} s is {period / h:.4g} samples of {h:g} s: "
            "give a period that is a whole number of samples, at least four"
        )
    begin = whole_number("left_out", left_out, least=0) * samples
    periods = (len(data) - begin) // samples
    if periods < 2:
        raise NotIdentifiableError(
            f"{max(0, periods)} periods of {period:g} s remain after {left_out} are "
            "left out, but at least two are needed for their covariance: record longer"
        )
    begin = len(data) - periods * samples  # the last ones, in which the transient has decayed most

    reference = data.reference[begin:].reshape(periods, samples)
    spread = float(np.max(np.ptp(reference, axis=0)))
    if spread > 1e-6 * float(np.ptp(reference)) or float(np.ptp(reference)) == 0.0:
        raise NotIdentifiableError(
            f"the reference does not repeat every {period:g} s (its periods differ by "
            f"{spread:.3g}, or it is constant): give the period of Experiment.multisine"
        )
    return reference


def _periodic_lines(
    asked: _Asked, command: Array, reference: Array, period: float, highest: float
) -> _Lines:
    """Lines up to `highest` Hz that the reference of each period, a row each, excites.

    The misfit of each is divided by its standard deviation between periods.
    """
    data, names, *_ = asked
    repeated, samples = reference.shape
    power = np.abs(np.fft.rfft(reference[0]))
    power[0] = 0.0  # the mean of an integrator's output holds no information
    frequencies = np.arange(power.size) / period
    lines = np.flatnonzero((power > EXCITED * power.max()) & (frequencies <= highest))
    lines = lines[2 * lines < samples]
    freedom = 2 * lines.size - len(names)
    if freedom < 2:
        raise NotIdentifiableError(
            f"{lines.size} excited lines of the spectrum are too "
            f"few to fit {len(names)} parameters: excite more frequencies"
        )
    # Complex degrees of freedom of the covariances between periods, averaged at the ends. The
    # inverse of a variance estimated with f of them is too large by f/(f - 1) on average.
    between = max(1.5, float((repeated - 1) * min(lines.size, 1 + NEIGHBOURS)))
    widening = between / (between - 1.0)
    rows = slice(len(data) - reference.size, None)
    made = partial(
        LinesMisfit.of_periods,
        command=command[rows],
        output=data.output[rows],
        samples=samples,
        lines=lines.tolist(),
    )
    longest = min(LONGEST * repeated, 1.0) * samples * data.sample_time
    describe = f"{lines.size} of {repeated} periods"
    return _Lines(*asked, made, True, freedom, widening, longest, describe)


def _residuals(data: Recording, response: HeldResponse, values: dict[str, float]) -> Array:
    """Recorded output minus the response to the commands, about its mean."""
    path = response.at(data.time - values["delay"], values["lag"]).value
    residuals = data.output - values["gain"] * path
    return np.asarray(residuals - residuals.mean())


def _message(names: tuple[str, ...], lines: _Lines, source: str, reliable: bool) -> str:
    text = f"maximum likelihood over {', '.join(names)} at the lines {lines.describe}"
    if source != "logged":
        text += f", the command {source}"
    if "lag" in names:
        text += (
            "; delay and lag have similar effects, so intervals are those of the profile likelihood"
        )
    if not reliable:
        text += (
            f"{REASONS}the residuals exceed the noise, so the model only approximates the vehicle"
        )
        if "lag" not in names:
            text += f"{ADVICE}free=('delay', 'gain', 'lag'))"
    return text
