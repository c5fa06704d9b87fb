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
from typing import Any, ClassVar, NamedTuple, TypeAlias

import numpy as np

import deadtime.estimation._least_squares as least_squares
import deadtime.estimation.data._checks as checks
from deadtime._base.arrays import Array, Indices
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

#: Most points of the initial grid over the delay, one for each sample if they are fewer.
MOST_POINTS = 400

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
        if self.period is None:
            lines = _record_lines((data, names, 0.0, known), commands, top)
        else:
            periods = whole_periods(data, self.period, self.left_out, top)
            lines = _periodic_lines((data, names, 0.0, known), command[rows], periods)
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
        cov = checks.embedded(
            np.asarray(wider * np.linalg.inv(jacobian.T @ jacobian)), loose, len(names)
        )
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
            uncalibrated=""
            if loop.is_sampled
            else (
                "the frequency method assumes that the command is constant between samples. "
                "The command of a continuous loop is not. Use method='waveform' for an "
                "interval"
            ),
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
        numbers = ("delay", "gain", "lag")
        places = [least_squares.place_of(name, self.names) for name in numbers]
        return self.made(
            ([self.known[name] for name in numbers], places, self.recording.sample_time)
        )

    def ends(self, label: str) -> least_squares.Ends:
        """Bounds and starting values of one of the parameters."""
        if label == "gain":
            return least_squares.Ends(-math.inf, math.inf, [self.known["gain"]])
        return least_squares.Ends(0.0, math.inf, [self.recording.sample_time])

    def fit(self) -> least_squares.Minimum:
        """The parameters of least cost; a lag that does not reduce it is zero."""
        row, lag = self.recording.sample_time, least_squares.place_of("lag", self.names)
        if "delay" not in self.names:
            found = self.problem.solve()
            return self.problem.without_vanishing(found, None, lag, 0.0)
        count = int(min(MOST_POINTS, max(2.0, self.longest / row)))
        grid = np.linspace(0.0, self.longest, count + 1)
        guess = np.array([self.known["gain"] if name == "gain" else row for name in self.names])
        costs, _, found = self.problem.scan(grid, guess, lag, 0.0)
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
    frequencies = np.fft.rfftfreq(size, data.sample_time)
    kept = (frequencies > 0.0) & (frequencies <= highest)
    nyquist = size % 2 == 0 and bool(kept[-1])
    real = 2 * int(kept.sum()) - int(nyquist)
    if real < 2 * (len(names) + 1):
        raise NotIdentifiableError(
            f"{int(kept.sum())} lines of the spectrum up to {highest:g} Hz are too few to "
            f"fit {len(names)} parameters: choose a longer window, or give a higher `highest`"
        )
    every = int(kept.sum()) == size // 2
    made = partial(
        LinesMisfit.of_record,
        commands=commands,
        time=data.time,
        output=data.output,
        last=None if every else int(kept.sum()),
    )
    longest = LONGEST * float(data.time[-1] - data.time[0])
    describe = f"{int(kept.sum())} of one record"
    freedom = real - len(names)
    return _Lines(*asked, made, False, freedom, 1.0, longest, describe)


def _periodic_lines(asked: _Asked, command: Array, periods: Periods) -> _Lines:
    """Excited lines of periods, over their standard deviations between periods."""
    data, names, *_ = asked
    freedom = 2 * periods.lines.size - len(names)
    if freedom < 2:
        raise NotIdentifiableError(
            f"{periods.lines.size} excited lines of the spectrum are too "
            f"few to fit {len(names)} parameters: excite more frequencies"
        )
    # The inverse of a variance estimated with f degrees of freedom is too large by f/(f - 1) on
    # average.
    widening = periods.freedom / (periods.freedom - 1.0)
    describe = f"{periods.lines.size} of {periods.repeated} periods"
    longest = min(LONGEST * periods.repeated, 1.0) * periods.samples * data.sample_time
    made = partial(
        LinesMisfit.of_periods,
        command=command[periods.rows],
        output=data.output[periods.rows],
        samples=periods.samples,
        lines=periods.lines.tolist(),
    )
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


#: A line of the reference counts as excited above this share of the largest line.
EXCITED = 1e-3

#: Lines to either side over which the kernel averages covariances.
NEIGHBOURS = 1

#: Largest deviation of a period from a whole number of samples, in samples.
WHOLE = 1e-3


class Periods(NamedTuple):
    """The whole periods that are used, and the lines of each.

    Attributes
    ----------
    rows : slice
    samples, repeated : int
        Samples in a period, and periods.
    lines : ndarray of int
        Harmonics of the period that the reference excites.
    """

    rows: slice
    samples: int
    repeated: int
    lines: Indices

    @property
    def freedom(self) -> float:
        """Complex degrees of freedom of the covariances between periods, averaged at the ends."""
        return max(1.5, float((self.repeated - 1) * min(self.lines.size, 1 + NEIGHBOURS)))


def whole_periods(data: Recording, period: float, left_out: int, highest: float) -> Periods:
    """The whole periods after the first `left_out`, and their lines up to `highest` Hz."""
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
    power = np.abs(np.fft.rfft(reference[0]))
    power[0] = 0.0  # the mean of an integrator's output holds no information
    excited = (power > EXCITED * power.max()) & (np.arange(power.size) / period <= highest)
    lines = np.flatnonzero(excited)
    lines = lines[2 * lines < samples]
    return Periods(slice(begin, None), samples, periods, lines)
