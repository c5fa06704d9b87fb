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
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from deadtime._base.arrays import Array, Mask
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import positive, whole_number
from deadtime._base.verdicts import verdict_if
from deadtime.estimation._native import LEVEL_OF_TESTS
from deadtime.estimation._result import ADVICE, REASONS, DelayEstimate
from deadtime.estimation.data._checks import (
    ROUNDING,
    check_distinguishable,
    check_gain,
    check_moves,
    checked_names,
    embedded,
    integrator_of,
    standard_errors,
)
from deadtime.estimation.data._periodic import PeriodicSpectra, periodic_spectra
from deadtime.estimation.data._simulated import commands_over_samples
from deadtime.estimation.fit._line_fit import LineProfile, Lines, fit_lines
from deadtime.estimation.fit._profile import Profile
from deadtime.estimation.fit._residuals import whiteness_of
from deadtime.estimation.methods._conclusion import estimate_with_residuals, is_rounding
from deadtime.estimation.methods._method import Method, Run
from deadtime.estimation.models._held import HeldResponse, held_transfer
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

#: Longest delay of the search, as a share of the record or of the periods.
LONGEST = 0.6

#: Largest relative deviation of the time between samples from its median.
EVEN = 1e-3


@dataclass(frozen=True)
class Frequency(Method):
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

    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the one recording."""
        from scipy import special

        ((recording, loop, window, *_),) = runs
        names = checked_names(free, loop)
        integrator_of(loop, "frequency")
        data = recording.window(*window)
        rows = recording.rows(*window)
        _check_even(data)
        command, source = commands_over_samples(recording, loop)
        response = HeldResponse(recording.time[: rows.stop], command[: rows.stop])
        check_moves(data.output, command[rows])
        top = math.inf if self.highest is None else self.highest
        if self.period is None:
            lines = _record_lines(data, response, len(names), top)
        else:
            spectra = periodic_spectra(data, command[rows], self.period, self.left_out, top)
            lines = _periodic_lines(spectra, data.sample_time, len(names))
        known = {name: loop.parameters[name] for name in ("gain", "lag")}
        known["delay"] = 0.0 if loop.delay is None else loop.delay
        found, jacobian = fit_lines(lines, names, known)
        loose = [i for i, name in enumerate(names) if name != "lag" or found["lag"] > 0.0]
        check_distinguishable(jacobian[:, loose], [names[i] for i in loose])
        power = lines.cost(found)
        scale = power / lines.freedom
        p_value, wider = 1.0, scale
        if lines.known_noise:
            p_value = float(special.chdtrc(lines.freedom, power / lines.widening))
            wider = max(lines.widening, scale)
        inverse = np.linalg.inv(jacobian[:, loose].T @ jacobian[:, loose])
        cov = embedded(np.asarray(wider * inverse), loose, len(names))
        values = {name: found[name] for name in names}
        errors = standard_errors(names, cov)
        check_gain(values, errors)
        residuals = _residuals(data, response, found)
        whiteness = whiteness_of(residuals, len(names))
        white = p_value > LEVEL_OF_TESTS if lines.known_noise else whiteness.white
        reliable = white or is_rounding(residuals, data)
        return estimate_with_residuals(
            "frequency",
            loop,
            data,
            values,
            cov,
            residuals,
            verdict=verdict_if(reliable),
            message=_message(names, lines, source, reliable),
            uncalibrated=_why_uncalibrated(loop),
            details={"lines": lines.describe, "command": source, "p_value_of_model": p_value},
            profile=Profile(
                cost=LineProfile(lines, names, found),
                best=power,
                freedom=lines.freedom,
                widening=dict.fromkeys(errors, math.sqrt(wider / scale) if scale > 0.0 else 1.0),
                preferred="delay and lag have similar effects" if "lag" in names else "",
            ),
        )


def _check_even(data: Recording) -> None:
    steps = np.diff(data.time)
    if float(np.max(np.abs(steps - data.sample_time))) > EVEN * data.sample_time:
        raise NotIdentifiableError(
            f"the samples are {float(steps.min()):g} to {float(steps.max()):g} s apart: a DFT "
            "needs evenly spaced ones; use method='output_error'"
        )


def _record_lines(data: Recording, response: HeldResponse, numbers: int, highest: float) -> Lines:
    """Lines of one record without the mean; white noise has the same size at each."""
    size = len(data)
    frequencies = np.fft.rfftfreq(size, data.sample_time)
    kept = (frequencies > 0.0) & (frequencies <= highest)
    nyquist = size % 2 == 0 and bool(kept[-1])
    real = 2 * int(kept.sum()) - int(nyquist)
    if real < 2 * (numbers + 1):
        raise NotIdentifiableError(
            f"{int(kept.sum())} lines up to {highest:g} Hz are too few for {numbers} parameters: "
            "widen the window or give a higher `highest`"
        )
    weight = np.full(int(kept.sum()), math.sqrt(2.0 / size))
    if nyquist:
        weight[-1] = math.sqrt(1.0 / size)

    misfit = partial(_record_misfit, data, response, weight, kept)
    describe = f"{int(kept.sum())} of one record"
    span = float(data.time[-1] - data.time[0])
    return Lines(misfit, False, real - numbers, 1.0, LONGEST * span, data.sample_time, describe)


def _periodic_lines(spectra: PeriodicSpectra, sample_time: float, numbers: int) -> Lines:
    """Excited lines of periods, over their standard deviations between periods."""
    freedom = 2 * spectra.lines.size - numbers
    if freedom < 2:
        raise NotIdentifiableError(
            f"{spectra.lines.size} excited lines are too few for {numbers} parameters: excite more"
        )
    # The inverse of a variance estimated with f degrees of freedom is too large by f/(f - 1) on
    # average.
    widening = spectra.freedom / (spectra.freedom - 1.0)
    describe = f"{spectra.lines.size} of {spectra.periods} periods"
    longest = min(LONGEST * spectra.periods, 1.0) * spectra.samples * sample_time
    misfit = partial(_periodic_misfit, spectra, sample_time)
    return Lines(misfit, True, freedom, widening, longest, sample_time, describe)


def _record_misfit(
    data: Recording,
    response: HeldResponse,
    weight: Array,
    kept: Mask,
    values: dict[str, float],
) -> Array:
    """Misfit at the `kept` lines of one record, times a weight."""
    spectrum = np.fft.rfft(data.output - values["gain"] * _path(data, response, values))
    lines = weight * spectrum[kept]
    return np.concatenate([lines.real, lines.imag])


def _periodic_misfit(
    spectra: PeriodicSpectra, sample_time: float, values: dict[str, float]
) -> Array:
    """Misfit at the excited lines over their standard deviation between periods."""
    z = np.exp(2j * np.pi * spectra.lines / spectra.samples)
    floor = ROUNDING * float(np.max(np.abs(spectra.output)))
    g = values["gain"] * held_transfer(z, values["delay"], values["lag"], sample_time)
    variance = (
        spectra.output_variance
        + np.abs(g) ** 2 * spectra.input_variance
        - 2.0 * (spectra.covariance * np.conj(g)).real
    )
    # Per real part; the sum of squares of all parts is then a chi-square.
    spread = np.sqrt(0.5 * np.maximum(variance, floor**2))
    lines = (spectra.output - g * spectra.input) / spread
    return np.concatenate([lines.real, lines.imag])


def _path(data: Recording, response: HeldResponse, values: dict[str, float]) -> Array:
    """Response to the commands for a gain of one."""
    return response.at(data.time - values["delay"], values["lag"]).value


def _residuals(data: Recording, response: HeldResponse, values: dict[str, float]) -> Array:
    """Recorded output minus the response to the commands, about its mean."""
    residuals = data.output - values["gain"] * _path(data, response, values)
    return np.asarray(residuals - residuals.mean())


def _why_uncalibrated(loop: ControlLoop) -> str:
    if loop.is_sampled:
        return ""
    return (
        "the frequency method takes the command as constant between samples, and that of a "
        "continuous loop is not; use method='waveform' for an interval"
    )


def _message(names: tuple[str, ...], lines: Lines, source: str, reliable: bool) -> str:
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
