"""Results of an estimation, with their uncertainty. Half of the file is documentation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.digits import between, stated
from deadtime._base.drawing import Axes, Figure, empty_figure
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.notebook import Pictured
from deadtime._base.plain import plain
from deadtime._base.validation import confidence, non_negative, real_array
from deadtime._base.verdicts import NOT_CLAIMED, Verdict, claimed, rough
from deadtime.estimation._felt import FELT, WORDS, Felt, highest_excited
from deadtime.estimation._least_squares import Profile, Whiteness, floor_of, unit_of
from deadtime.estimation._native import FlightProfile
from deadtime.estimation._plant import behind_limits
from deadtime.experiments import FlightNoise
from deadtime.loops import Controller, ControlLoop, Explorer, explorer_of
from deadtime.recordings import Recording

#: What is before the reasons of an indication in its message, and what begins the advice.
REASONS, ADVICE = "; indication: ", " (try "


@dataclass(frozen=True, eq=False)
class CramerRaoBound(ReadOnlyArrays):
    """Smallest standard deviations an unbiased estimator can have on this recording.

    Attributes
    ----------
    free : tuple of str
        The parameters that are taken as unknown; the bound depends on them.
    noise : FlightNoise
        The noise it is for; in a joint fit that of the first recording.
    stderr : dict of str to float
        The bound for each free quantity, and for ``delay+lag`` where both are free.
    """

    free: tuple[str, ...]
    noise: FlightNoise
    stderr: dict[str, float]


@dataclass(frozen=True, eq=False)
class FittedRun(ReadOnlyArrays):
    """One of the recordings of a fit, with its fitted loop.

    Attributes
    ----------
    recording : Recording
        The fitted window.
    loop : ControlLoop
        The recorded loop with the fitted parameters.
    residuals : ndarray, shape (n,)
        Recorded minus simulated output.
    noise : FlightNoise or None
        The noise that was fitted to this recording, where the method does that.
    """

    recording: Recording
    loop: ControlLoop
    residuals: Array
    noise: FlightNoise | None = None


def of_runs(runs: tuple[FittedRun, ...]) -> dict[str, Any]:
    """The fields of a `DelayEstimate` from its runs: those of the first, and `others`."""
    return {**vars(runs[0]), "others": runs[1:]}


@dataclass(frozen=True, eq=False, repr=False)
class DelayEstimate(Felt, ReadOnlyArrays, Pictured):
    """An estimated delay, with the fitted loop and the uncertainty of every fitted parameter.

    Attributes
    ----------
    method : str
        Name of the method.
    loop : ControlLoop
        The loop with the fitted parameters.
    free : tuple of str
        Names of the fitted parameters.
    stderr : dict of str to float
        Standard errors of the free quantities, s or the unit of the gain, and of ``delay+lag``
        where the delay is free. They are robust ones where the residuals are not white, and NaN
        where the method has none (see `uncalibrated`).
    cov : ndarray, shape (len(free), len(free))
        Their covariance.
    crb : CramerRaoBound or None
        The Cramér-Rao bound, with the parameters it takes as free.
    recording : Recording
        The fitted window.
    residuals : ndarray
        Recorded minus simulated output.
    whiteness : Whiteness
        Test of the residuals.
    verdict : {"reliable", "indication"}
        Whether the intervals are claimed to hold, because the model explains the recording; or
        whether the numbers are an indication, because it only approximates the vehicle.
    message : str
        Description of the fit and remarks on it.
    uncalibrated : str
        Why there is no interval; empty where there is one.
    details : dict
        Further results of the method, such as the overshoot. Those of a likelihood have
        ``"unseen_lag"``: a further lag of that size, s, would have been found with a probability
        of 90 %, and one below it may be there unseen; infinite where no lag would be found.
    others : tuple of FittedRun
        The further recordings of a joint fit; `loop`, `recording` and `residuals` are those of
        the first.
    noise : FlightNoise or None
        The noise that was fitted beside the plant, where the method does that; in a joint fit that
        of the first recording. `runs` has that of each.
    """

    method: str
    loop: ControlLoop
    free: tuple[str, ...]
    stderr: dict[str, float]
    cov: Array
    crb: CramerRaoBound | None
    recording: Recording
    residuals: Array
    whiteness: Whiteness
    verdict: Verdict
    message: str
    uncalibrated: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)
    others: tuple[FittedRun, ...] = ()
    noise: FlightNoise | None = None
    _profile: Profile | FlightProfile | None = None
    _beside: float = 0.0

    @property
    def runs(self) -> tuple[FittedRun, ...]:
        """All recordings that were fitted together, the first one included."""
        return (FittedRun(self.recording, self.loop, self.residuals, self.noise), *self.others)

    @property
    def delay(self) -> float:
        """The delay of the loop, s."""
        return float(self.loop.parameters["delay"])

    @property
    def gain(self) -> float | None:
        """Gain of the plant, fitted or as given; None if the plant has no such parameter."""
        return self.loop.parameters.get("gain")

    @property
    def lag(self) -> float | None:
        """Lag of the plant, s, fitted or as given; None if the plant has no such parameter.

        Of a `FactoredPlant` or a `ParametricPlant` the total lag (its ``lag``). Of a plant that
        limits rates, that of the plant after the limits.
        """
        return getattr(behind_limits(self.loop.plant), "lag", None)

    @property
    def delay_plus_lag(self) -> float:
        """The sum of delay and lag, s, which is well determined also where its parts are not."""
        return self.delay + (self.lag or 0.0)

    @property
    def calibrated(self) -> bool:
        """Whether the method has confidence intervals with the stated coverage."""
        return not self.uncalibrated

    @property
    def has_profile(self) -> bool:
        """Whether the method has a profile."""
        return self._profile is not None

    @property
    def rms(self) -> float:
        """Root mean square of the residuals of all recordings, in the unit of the output."""
        squares = [run.residuals**2 for run in self.runs]
        return float(np.sqrt(np.mean(np.concatenate(squares))))

    def ci(self, level: float = 0.95, name: str = "delay") -> tuple[float, float]:
        """Confidence interval of a fitted quantity.

        Parameters
        ----------
        level : float
            Between 0 and 1.
        name : str
            One of `free`, or ``"delay+lag"`` (``"delay+time_constant"`` where that was fitted);
            of what a loop feels, ``"largest_gain"``, ``"crossover"``, ``"gain_at_crossover"``,
            ``"phase_at_crossover"`` and ``"delay_at_crossover"``.

        Returns
        -------
        (float, float)
            In seconds for a delay or lag, and not below zero for these. Not claimed to hold where
            the verdict is ``"indication"``.

        Raises
        ------
        ValueError
            When the method cannot give an interval (the message says why), the level is not
            between 0 and 1, or the quantity was not fitted.
        """
        from scipy import special

        confidence(level)
        if not self.calibrated:
            raise ValueError(f"no interval: {self.uncalibrated}")
        if name in FELT:
            if not math.isfinite(self.crossover):
                raise ValueError(
                    f"{name} has no interval, because no proportional gain makes the loop unstable"
                )
            return self._felt_interval(level, name)
        self._check_fitted(name, "intervals")
        value, beside = self._value(name), self._added(name)
        if self._profile is not None and self._profile.preferred:
            low, high = self._profile.interval(name, value, self._reach(name), level)
            if not beside:
                return low, high
            reach = beside * float(special.ndtri(0.5 + level / 2))
            low = value - math.hypot(value - low, reach)
            return max(low, floor_of(name)), value + math.hypot(high - value, reach)
        reach = self.quantile(level) * self.stderr[name]
        low = value - reach
        return (max(low, floor_of(name)), value + reach)

    def quantile(self, level: float) -> float:
        """That of Student's distribution that goes with the standard errors at a level."""
        from scipy import special

        freedom = float(max(1, sum(run.residuals.size for run in self.runs) - len(self.free)))
        if self._profile is not None:
            freedom = min(self._profile.freedom_of(name) for name in self.free)
        return float(special.stdtrit(freedom, 0.5 + level / 2))

    def explore(
        self,
        controller: Controller | None = None,
        ranges: Mapping[str, tuple[float, float]] | None = None,
    ) -> Explorer:
        """Return a page with the fitted loop, and the interval of its delay if it is reliable.

        Parameters
        ----------
        controller : P, PI, PD, PV or PID, optional
            Shown around the fitted plant instead of that of the recording.
        ranges : mapping of str to (low, high), optional
            As of `deadtime.ControlLoop.explore`.

        Returns
        -------
        deadtime.Explorer
            See `deadtime.ControlLoop.explore`.

        Raises
        ------
        ValueError
            If the explorer has no such loop.
        """
        reliable = self.verdict == "reliable"
        known = self.calibrated and reliable and "delay" in self.free
        interval = self.ci() if known else None
        loop = self.loop if controller is None else self.loop.replace(controller=controller)
        page = explorer_of(loop.specification, ranges, interval)
        return page if reliable else replace(page, title="A fitted loop (only an indication)")

    def profile(self, name: str = "delay", values: ArrayLike | None = None) -> tuple[Array, Array]:
        """Profile likelihood: the increase of the cost when one quantity is held.

        Parameters
        ----------
        name : str
            One of `free`, or ``"delay+lag"``.
        values : array_like, shape (n,), optional
            Values at which it is held; by default 41, four standard errors to either side.

        Returns
        -------
        values, t : ndarray, shape (n,)
            At each value the quantile t of the confidence interval that ends there: 1.96 at the
            ends of a 95 % interval of many samples, and 0 at the fitted value.

        Raises
        ------
        ValueError
            When the method has no profile or the quantity was not fitted.
        """
        if self._profile is None:
            raise ValueError(
                f"the {self.method} method gives no profile "
                "likelihood. Use method='output_error' or 'waveform'"
            )
        self._check_fitted(name, "profiles")
        if values is None:
            middle, reach = self._value(name), 4.0 * self._reach(name)
            low = max(middle - reach, floor_of(name))
            values = np.linspace(low, middle + reach, 41)
        held = np.atleast_1d(real_array("values", values))
        found = np.sqrt([self._profile.statistic(name, float(value)) for value in held])
        away, beside = held - self._value(name), self._added(name)
        if beside:
            # Of a parabola: its standard error away/t and this one in quadrature.
            found *= np.abs(away) / np.maximum(np.hypot(away, beside * found), 1e-300)
        return held, found

    def _check_fitted(self, name: str, what: str) -> None:
        """Refuse a quantity of which there are no intervals or profiles."""
        if name not in self.stderr:
            names = ", ".join(self.stderr)
            raise ValueError(f"{name!r} was not fitted. There are {what} only for {names}")

    def _value(self, name: str) -> float:
        """The fitted value of a quantity."""
        if name == "delay+lag":
            return self.delay_plus_lag
        known = {**self.loop.parameters, **self.details}
        return float(sum(known.get(part, 0.0) for part in name.split("+")))

    def with_error_beside(self, error: float) -> DelayEstimate:
        """The estimate where the delay has a further error that the fit does not know.

        Parameters
        ----------
        error : float
            Its standard deviation, s. It is independent of that of the fit, whose intervals are
            widened by it in quadrature.
        """
        square = non_negative("error", error) ** 2
        if "delay" not in self.free or not square:
            return self
        stderr = {
            name: math.sqrt(value**2 + square) if holds_delay(name) else value
            for name, value in self.stderr.items()
        }
        cov, place = self.cov.copy(), self.free.index("delay")
        cov[place, place] += square
        beside = math.hypot(self._beside, error)
        return replace(self, stderr=stderr, cov=cov, _beside=beside)

    def _added(self, name: str) -> float:
        """The error of a quantity that the fit does not know."""
        return self._beside if holds_delay(name) else 0.0

    def _reach(self, name: str) -> float:
        """About one standard error; for a quantity at its bound, the largest of the other times."""
        return self.stderr[name] or max(
            (error for other, error in self.stderr.items() if unit_of(other) == "s"), default=0.0
        )

    def to_dict(self, intervals: Iterable[str] | None = None) -> dict[str, Any]:
        """All results but the arrays, as plain values for JSON.

        Parameters
        ----------
        intervals : iterable of str, optional
            Of which quantities there are intervals, of all by default: some take long.
        """
        found: dict[str, Any] = {
            "method": self.method,
            "delay": self.delay,
            "gain": self.gain,
            "lag": self.lag,
            "delay_plus_lag": self.delay_plus_lag,
            "free": list(self.free),
            "stderr": plain(self.stderr),
            "interval_95": None
            if self.uncalibrated
            else {name: list(self.ci(0.95, name)) for name in intervals or self.stderr},
            **{name: getattr(self, name) for name in FELT[:2] + FELT[-1:]},
            "rms": self.rms,
            "white": self.whiteness.white,
            "residual_autocorrelation": self.whiteness.autocorrelation,
            "verdict": self.verdict,
            "reason": self.reason,
            "message": self.message,
        }
        models = [plain(vars(run.noise)) for run in self.runs if run.noise is not None]
        if models:
            found["noise_model"] = models[0]
        if len(models) > 1:
            found["noise_models"] = models
        if self.uncalibrated:
            found["no_interval_because"] = self.uncalibrated
        return found | dict(self.details)

    @property
    def reason(self) -> str:
        """Why the verdict is not ``"reliable"``; empty where it is."""
        if self.verdict == "reliable":
            return ""
        why = self.message.partition(REASONS)[2].partition(ADVICE)[0]
        return why or (
            "the residuals are not white (lag-1 autocorrelation "
            f"{self.whiteness.autocorrelation:.2f})"
        )

    @property
    def description(self) -> str:
        """The message without what speaks against the model, and without advice."""
        return self.message.partition(REASONS)[0].partition(ADVICE)[0]

    @property
    def advice(self) -> str:
        """What to do next, where the verdict is not ``"reliable"`` and the method knows."""
        return self.message.partition(ADVICE)[2].removesuffix(")")

    def headline(self) -> str:
        """The verdict and the delay; why it is not reliable where it is not."""
        given = "delay" not in self.free
        if self.verdict != "reliable":
            how = "as it was given" if given else NOT_CLAIMED
            return f"{self.verdict}: delay about {rough(self.delay, 's')}, {how}; {self.reason}"
        if given or not self.calibrated:
            how = "as it was given" if given else "without an interval"
            return f"reliable: delay {stated(self.delay, math.nan, 's')}, {how}"
        error = self.stderr["delay"]
        ends = between(*self.ci(0.95), error, "s")
        return f"reliable: delay {stated(self.delay, error, 's')} (95 %: {ends})"

    def doubted(self, why: str, advice: str = "") -> DelayEstimate:
        """The estimate as an indication, for this further reason.

        Parameters
        ----------
        why : str
            The reason, in words that follow "indication: ".
        advice : str
            What to try, in place of what was advised before.
        """
        known, begins, advised = self.message.partition(ADVICE)
        if advice:
            begins, advised = ADVICE, f"{advice})"
        message = f"{known}{'; ' if REASONS in known else REASONS}{why}{begins}{advised}"
        return replace(self, verdict="indication", message=message)

    def summary(self) -> str:
        """The answer as a few lines of text, the verdict first."""
        lines = [self.headline(), f"  {self.method}: {self.description}", *self.numbers()]
        return "\n".join([*lines, f"next: try {self.advice}"] if self.advice else lines)

    def numbers(self) -> list[str]:
        """Every fitted quantity, the bound and the residuals, a line each."""
        lines = []
        if self.others:
            rows = " + ".join(str(len(run.recording)) for run in self.runs)
            lines.append(f"  {len(self.runs)} recordings together, {rows} samples")
        width = max((len(name) for name in self.stderr), default=0) + 1
        for name, stderr in self.stderr.items():
            value, unit = self._value(name), unit_of(name)
            if self.verdict != "reliable":
                words = claimed(self.verdict, value, stderr, unit)
            elif self.calibrated:
                words = f"{stated(value, stderr, unit):<18}"
                words += f" 95 %: {between(*self.ci(0.95, name), stderr, unit)}"
            else:
                words = stated(value, math.nan, unit)
            lines.append(f"  {name:<{width}} {words}")
        if not self.calibrated:
            lines.append(f"  no interval: {self.uncalibrated}")
        if self.crb is not None and "delay" in self.crb.stderr:
            bound = float(f"{self.crb.stderr['delay']:.2g}")
            noises = [str(run.noise) for run in self.runs if run.noise is not None]
            lines.append(
                f"  Cramér-Rao bound {stated(bound, math.nan, 's')}, for "
                f"{' | '.join(noises) or self.crb.noise} and unknown {', '.join(self.crb.free)}"
            )
        lines += self._felt_lines()
        kind = "white" if self.whiteness.white else "coloured"
        lines.append(
            f"  residuals with an rms of {self.rms:.4g}, {kind} (lag-1 "
            f"autocorrelation {self.whiteness.autocorrelation:.2f})"
        )
        return lines

    def _felt_lines(self) -> list[str]:
        """What a loop feels of the plant: at crossover, or where the command still moves."""
        if not self.loop.plant.is_linear:
            return []
        if math.isfinite(self.crossover):
            values = ("largest_gain", ""), ("crossover", "rad/s"), ("delay_at_crossover", "s")
            parts = []
            for name, unit in values:
                error = math.nan
                if self.verdict == "reliable" and self.calibrated:
                    low, high = self.ci(0.95, name)
                    error = (high - low) / (2.0 * self.quantile(0.95))
                shown = claimed(self.verdict, float(getattr(self, name)), error, unit)
                parts.append(f"{WORDS[name]} {shown}")
            return [f"  {', '.join(parts)} (without a hold)"]
        line = "  no proportional gain makes the loop unstable"
        omega = highest_excited(self.recording, self.loop)
        if math.isfinite(omega):
            view = self.at(omega)
            line += (
                f". At {omega:.3g} rad/s, the highest frequency of the command: gain "
                f"{rough(view.gain[0])}, equivalent delay {rough(view.delay[0], 's')}"
            )
        return [line]

    def plot(self, ax: Sequence[Axes] | None = None) -> list[Axes]:
        """Draw the fit over the data, the residuals, and the profile of the delay.

        Needs matplotlib.

        Parameters
        ----------
        ax : sequence of matplotlib.axes.Axes, optional
            For each recording one for the output and one for the residuals, then one for the
            profile where there is one. By default those of a new figure.

        Returns
        -------
        list of matplotlib.axes.Axes

        Raises
        ------
        ValueError
            If `ax` holds another number of axes.
        """
        from deadtime.estimation._plots import plot_estimate

        return plot_estimate(self, ax)

    def _picture(self) -> Figure:
        from deadtime.estimation._plots import estimate_axes

        figure = empty_figure(10.0, 4.6)
        self.plot(estimate_axes(self, figure))
        return figure

    def __repr__(self) -> str:
        error = self.stderr["delay"] if self.calibrated and "delay" in self.stderr else math.nan
        return (
            f"<DelayEstimate {self.method}: {self.verdict}, delay "
            f"{claimed(self.verdict, self.delay, error, 's')}>"
        )


def holds_delay(name: str) -> bool:
    """Whether a quantity is the delay, or a sum with it."""
    return "delay" in name.split("+")


def bic(fit: DelayEstimate) -> float:
    """Schwarz's criterion (BIC) of a fit, by which plants are compared: from the likelihood."""
    if isinstance(fit._profile, FlightProfile):
        return fit._profile.fit.schwarz(len(fit.free))
    # Least squares: white noise.
    square = np.concatenate([run.residuals for run in fit.runs]) ** 2
    least = max(float(np.mean(square)), np.finfo(float).tiny)
    return square.size * math.log(least) + len(fit.free) * math.log(square.size)
