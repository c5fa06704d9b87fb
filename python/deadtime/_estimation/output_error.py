"""Output error with the command as logged: the response of the vehicle alone, not of the loop.

    y(t_i) = b + a F(t_i - Td; lag) + noise,

F the exact response of 1/(s (lag s + 1)) to the command as it was held (`held_response`), a the
gain, b the output at the start. The command being known, noise that circulates in the loop and a
limit are no matter, and least squares is maximum likelihood for white noise: the standard error
is the Cramér-Rao bound. For a given delay and lag the best a and b are linear least squares
(variable projection, Golub & Pereyra 1973), so the search is over delay and lag alone; its cost
has several valleys over the delay, so a grid comes first. Where a lag is fitted too (it bends the
cost, and may lie at zero, its bound) or samples are few, the intervals are those of the profile
likelihood: all values whose best fit is worse by less than the t quantile squared allows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize_scalar

from deadtime._controllers import P
from deadtime._errors import NotIdentifiableError
from deadtime._estimation.evidence import (
    check_distinguishable,
    checked_names,
    embedded,
    standard_errors,
)
from deadtime._estimation.held_response import HeldResponse
from deadtime._estimation.profile import Profile
from deadtime._estimation.residuals import robust_covariance, white_covariance, whiteness_of
from deadtime._estimation.result import CramerRaoBound, DelayEstimate
from deadtime._loop import ControlLoop
from deadtime._plants import Integrator
from deadtime._recording import Recording

__all__ = ["estimate_by_output_error"]

Array = NDArray[np.float64]

#: The best fit for one number, the others at their best or held.
_Along: TypeAlias = Callable[[float], "_Fit"]

#: Longest delay that is sought, as a part of the window.
LONGEST = 0.6

#: Points of the grid over the delay, at most; four to a sample if there are fewer.
MOST_POINTS = 600

#: Lags of the grid, in samples.
LAGS = (0.0, 2.0, 8.0)

#: Fewer samples than this for each fitted number are few.
FEW = 12


def estimate_by_output_error(
    recording: Recording,
    loop: ControlLoop,
    window: tuple[float | None, float | None] | None,
    free: Sequence[str],
    initial_output: float | None = None,
) -> DelayEstimate:
    """Fit `free` to the response of the plant to the logged command."""
    names = checked_names(free, loop)
    if not isinstance(loop.plant, Integrator):
        raise ValueError(
            f"the output-error method is for an Integrator, the loop has a "
            f"{type(loop.plant).__name__}: use method='waveform'"
        )
    problem = _problem(recording, loop, window, names, initial_output)
    data = problem.recording
    found = problem.solve()
    residuals = -found.misfit
    jacobian = problem.jacobian(found)
    values = problem.values(found)
    held = [name for name in ("lag",) if name in names and found.lag == 0.0]
    labels = [*names, *(["initial output"] if problem.offset is None else [])]
    loose = [i for i, name in enumerate(labels) if name not in held]
    check_distinguishable(jacobian[:, loose], [labels[i] for i in loose])
    whiteness = whiteness_of(residuals, len(names))
    exact = float(np.max(np.abs(residuals))) <= 1e-9 * float(np.ptp(data.output))
    size = jacobian.shape[1]
    white = embedded(white_covariance(jacobian[:, loose], residuals), loose, size)
    spread = white
    if not (whiteness.white or exact):
        spread = embedded(robust_covariance(jacobian[:, loose], residuals), loose, size)
    count = len(names)
    errors = standard_errors(names, spread)
    reason = _why_not_gauss(found.lag, errors, len(data), count)
    adequate = whiteness.white or exact
    return DelayEstimate(
        method="output_error",
        loop=loop.replace(**values),
        free=names,
        stderr=errors,
        cov=spread[:count, :count],
        crb=CramerRaoBound(
            tuple(labels),
            math.sqrt(float(residuals @ residuals) / (residuals.size - len(loose))),
            standard_errors(names, white),
        ),
        recording=data,
        residuals=residuals,
        whiteness=whiteness,
        adequate=adequate,
        message=_message(names, problem.reconstructed, adequate, reason),
        details={"initial_output": found.offset, "command": problem.source},
        _profile=Profile(
            cost=problem.profile(found),
            best=found.cost,
            freedom=residuals.size - len(loose),
            widening={
                name: (errors[name] / error if error > 0.0 else 1.0)
                for name, error in standard_errors(names, white).items()
            },
            preferred=reason,
        ),
    )


@dataclass(frozen=True)
class _Fit:
    """Delay, lag, gain and output at the start, and simulated minus recorded output."""

    delay: float
    lag: float
    gain: float
    offset: float
    misfit: Array

    @cached_property
    def cost(self) -> float:
        return float(self.misfit @ self.misfit)


@dataclass(frozen=True, eq=False)
class _Problem:
    """The least-squares problem, gain and offset projected out."""

    recording: Recording
    response: HeldResponse
    names: tuple[str, ...]
    known: dict[str, float]
    offset: float | None
    source: str

    @property
    def reconstructed(self) -> bool:
        return self.source != "logged"

    @cached_property
    def span(self) -> float:
        return float(self.recording.time[-1] - self.recording.time[0])

    def at(self, delay: float, lag: float, gain: float | None = None) -> _Fit:
        """The best gain and offset for this delay and lag, `gain` fixed if given."""
        if gain is None and "gain" not in self.names:
            gain = self.known["gain"]
        data = self.recording
        path = self.response.at(data.time - delay, lag).value
        target = data.output if self.offset is None else data.output - self.offset
        centre, level = 0.0, 0.0
        if self.offset is None:
            centre, level = float(path.mean()), float(target.mean())
        moved, wanted = path - centre, target - level
        if gain is None:
            power = float(moved @ moved)
            gain = float(moved @ wanted) / power if power > 0.0 else 0.0
        offset = level - gain * centre if self.offset is None else self.offset
        return _Fit(delay, lag, gain, offset, gain * moved - wanted)

    def values(self, fit: _Fit) -> dict[str, float]:
        found = {"delay": fit.delay, "gain": fit.gain, "lag": fit.lag}
        return {name: found[name] for name in self.names}

    def jacobian(self, fit: _Fit) -> Array:
        """Derivatives of the simulated output by `names`, then by the offset if it is fitted."""
        response = self.response.at(self.recording.time - fit.delay, fit.lag)
        columns = {
            "delay": -fit.gain * response.rate,
            "gain": response.value,
            "lag": fit.gain * response.by_lag,
        }
        found = [columns[name] for name in self.names]
        if self.offset is None:
            found.append(np.ones(len(self.recording)))
        return np.stack(found, axis=1)

    def solve(self) -> _Fit:
        """The best fit, from the best points of a grid."""
        if "delay" not in self.names:
            return self._over_lag(self.known["delay"])
        best = self._over_delay(self.known["lag"])
        if "lag" not in self.names:
            return best
        starts = [self._over_delay(lag * self._sample, coarse=True) for lag in LAGS]
        for start in sorted(starts, key=lambda fit: fit.cost)[:2]:
            found = self._over_both(start)
            # At its bound a lag is worth something only if it improves the fit.
            if found.cost < best.cost * (1.0 - 1e-9):
                best = found
        return best

    @cached_property
    def _sample(self) -> float:
        return float(np.median(np.diff(self.recording.time)))

    def _over_delay(self, lag: float, gain: float | None = None, coarse: bool = False) -> _Fit:
        """The best delay for a lag."""
        longest = LONGEST * self.span
        each = 1 if coarse else 4
        points = int(min(MOST_POINTS, max(2.0, each * longest / self._sample)))
        grid = np.linspace(0.0, longest, points + 1)
        costs = [self.at(float(delay), lag, gain).cost for delay in grid]
        place = int(np.argmin(costs))
        ends = grid[max(0, place - 1)], grid[min(points, place + 1)]
        if place == points:
            raise NotIdentifiableError(
                f"the fit runs away to a delay of {longest:g} s, {LONGEST:g} of the window: the "
                "output is no answer to this command; check columns and units, or choose a longer "
                "window"
            )
        if coarse:
            return self.at(float(grid[place]), lag, gain)
        return self._polished(self._best_in(*ends, lambda delay: self.at(delay, lag, gain)))

    @staticmethod
    def _best_in(low: float, high: float, at: _Along) -> _Fit:
        """The best fit along one number between two ends, the ends included."""
        found = minimize_scalar(
            lambda value: at(float(value)).cost,
            bounds=(low, high),
            method="bounded",
            options={"xatol": 1e-10 * max(high, 1e-3)},
        )
        return min((at(float(found.x)), at(low), at(high)), key=lambda fit: fit.cost)

    def _polished(self, fit: _Fit) -> _Fit:
        """Gauss-Newton steps in the delay while they help.

        A scalar search for the least cost ends at half of the digits.
        """
        for _ in range(4):
            rate = self.response.at(self.recording.time - fit.delay, fit.lag).rate
            column = -fit.gain * (rate - rate.mean() if self.offset is None else rate)
            power = float(column @ column)
            if power == 0.0:
                break
            moved = fit.delay - float(column @ fit.misfit) / power
            if moved < 0.0:
                break
            better = self.at(moved, fit.lag, None if "gain" in self.names else fit.gain)
            if not better.cost < fit.cost:
                break
            fit = better
        return fit

    def _over_lag(self, delay: float, gain: float | None = None) -> _Fit:
        """The best lag for a delay."""
        if "lag" not in self.names:
            return self.at(delay, self.known["lag"], gain)
        grid = np.concatenate([[0.0], np.geomspace(1e-2 * self._sample, 0.3 * self.span, 16)])
        costs = [self.at(delay, float(lag), gain).cost for lag in grid]
        place = int(np.argmin(costs))
        low, high = grid[max(0, place - 1)], grid[min(len(grid) - 1, place + 1)]

        def at(lag: float) -> _Fit:
            return self.at(delay, lag, gain)

        return self._best_in(float(low), float(high), at)

    def _over_both(self, start: _Fit, gain: float | None = None) -> _Fit:
        """The best delay and lag near a start."""

        def misfit(point: Array) -> Array:
            return self.at(float(point[0]), float(point[1]), gain).misfit

        found = least_squares(
            misfit,
            [start.delay, max(start.lag, 0.5 * self._sample)],
            bounds=([0.0, 0.0], [self.span, self.span]),
            x_scale=[self._sample, self._sample],
            xtol=1e-12,
            ftol=1e-12,
            gtol=1e-12,
            max_nfev=60,
        )
        return self.at(float(found.x[0]), float(found.x[1]), gain)

    def profile(self, best: _Fit) -> _ProfileCost:
        return _ProfileCost(self, best)


@dataclass(frozen=True)
class _ProfileCost:
    """Least cost with one quantity held, the others free."""

    problem: _Problem
    best: _Fit

    def __call__(self, name: str, value: float) -> float:
        problem = self.problem
        if name == "delay":
            return problem._over_lag(value).cost
        if name == "lag":
            return self._near(lambda delay: problem.at(delay, value)).cost
        if name == "gain":
            if "delay" not in problem.names:
                return problem._over_lag(self.best.delay, value).cost
            if "lag" not in problem.names:
                return self._near(lambda delay: problem.at(delay, self.best.lag, value)).cost
            return problem._over_both(self.best, value).cost
        # delay+lag: the sum held, its parts free
        if "lag" not in problem.names:
            return problem.at(max(0.0, value - self.best.lag), self.best.lag).cost
        return problem._best_in(0.0, value, lambda lag: problem.at(value - lag, lag)).cost

    def _near(self, at: _Along) -> _Fit:
        """Over the delay, around the best sum of delay and lag: no other valley is meant."""
        reach = self.best.delay + self.best.lag + 4.0 * self.problem._sample
        return self.problem._best_in(0.0, reach, at)


def _problem(
    recording: Recording,
    loop: ControlLoop,
    window: tuple[float | None, float | None] | None,
    names: tuple[str, ...],
    initial_output: float | None,
) -> _Problem:
    """Commands up to the end of the window, from before its start where the rows tell them."""
    ends = window or (None, None)
    rows = recording.rows(*ends)
    data = recording.window(*ends)
    command, source = _commands(recording, loop)
    command = command[: rows.stop]
    if len(data) < 2 * (len(names) + 2):
        raise NotIdentifiableError(
            f"{len(data)} samples are too few for {len(names)} numbers and an initial output: "
            "widen the window"
        )
    if float(np.ptp(command)) == 0.0:
        raise NotIdentifiableError(
            f"the command is {command[0]:g} throughout the window: nothing excites the vehicle; "
            "choose a window in which the command changes"
        )
    if float(np.ptp(data.output)) == 0.0:
        raise NotIdentifiableError(
            f"the output is {data.output[0]:g} throughout the window: the vehicle did not move"
        )
    return _Problem(
        recording=data,
        response=HeldResponse(recording.time[: rows.stop], command),
        names=names,
        known={
            "gain": loop.parameters["gain"],
            "lag": loop.parameters["lag"],
            "delay": 0.0 if loop.delay is None else loop.delay,
        },
        offset=initial_output,
        source=source,
    )


def _commands(recording: Recording, loop: ControlLoop) -> tuple[Array, str]:
    """The command of every row: logged, or as the controller makes it of reference and output."""
    limit = math.inf if loop.limit is None else loop.limit
    if recording.command is not None:
        return np.clip(recording.command, -limit, limit), "logged"
    if loop.sample_time is None or not isinstance(loop.controller, P):
        raise NotIdentifiableError(
            "the recording holds no command, and only that of a sampled P controller can be "
            "computed from reference and output: log the command, or use method='waveform'"
        )
    command = loop.controller.Kp * (recording.reference - recording.output)
    return np.clip(command, -limit, limit), "computed from reference and output"


def _why_not_gauss(lag: float, errors: dict[str, float], samples: int, numbers: int) -> str:
    if "lag" in errors:
        return "the lag came out at zero, its bound" if lag == 0.0 else "delay and lag are alike"
    if samples < FEW * (numbers + 1):
        return f"{samples} samples are few"
    return ""


def _message(names: tuple[str, ...], reconstructed: bool, adequate: bool, reason: str) -> str:
    text = f"least squares over {', '.join(names)} on the response to the command"
    if reconstructed:
        text += ", which was not logged but computed from reference and output"
    if reason:
        text += f"; {reason}, so intervals are those of the profile likelihood"
    if not adequate:
        text += (
            "; the residuals are not white, so the model is only an equivalent of the vehicle and "
            "the intervals are robust ones"
        )
        if "lag" not in names:
            text += " (try free=('delay', 'gain', 'lag'))"
    return text
