"""`adaptive_gains`: sets of gains for parts of the delay's range, proved stable together."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from deadtime._base.errors import NotProvedError
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.notebook import Pictured
from deadtime._base.progress import Stages, stage_report
from deadtime._base.validation import interval, non_negative, positive, whole_number
from deadtime.estimation import DelayEstimate
from deadtime.loops import ControlLoop
from deadtime.tuning._design import design
from deadtime.tuning._problem import ObjectiveName, with_filter
from deadtime.tuning._result import Design
from deadtime.tuning.adaptive._claims import Claims
from deadtime.tuning.adaptive._follow import GainFollower
from deadtime.tuning.adaptive._given import claimed, loop_and_gain, sample_time_of
from deadtime.tuning.adaptive._proof import SwitchingProof
from deadtime.tuning.adaptive._search import proved

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Most sets of gains, and the largest number of states for which a form is searched.
MOST_SETS, MOST_STATES = 8, 16

#: Least factors that are tried, in those at which a step alone meets the limit: a smaller one
#: permits larger steps and is harder to prove.
_SHARES = (0.6, 0.3, 0.15)

#: Factors above one are lowered in this many halvings until there is a proof.
_HALVINGS = 5

#: An end of the range this close to a whole sample, in samples, is there.
_WHOLE = 1e-6


@dataclass(frozen=True, eq=False)
class GainSet(ReadOnlyArrays):
    """Gains, and the interval of the delay in which they may be used.

    Attributes
    ----------
    factor : float
        Factor on the robust gains, at least one.
    gains : dict of str to float
        By name.
    delays : (float, float)
        s.
    """

    factor: float
    gains: dict[str, float]
    delays: tuple[float, float]


@dataclass(frozen=True, eq=False, repr=False)
class GainSchedule(ReadOnlyArrays, Pictured):
    """Sets of gains for parts of the delay's range, stable however the delay moves between them.

    Made by `adaptive_gains`.

    Attributes
    ----------
    loop : ControlLoop
        The loop with the robust gains and the longest delay.
    sets : tuple of GainSet
        The fastest first; the last one holds the robust gains, for the whole range.
    proof : SwitchingProof
        One quadratic form for all sets and delays; `SwitchingProof.verify` checks it again.
    lowered : float
        Share of the distance from the robust gains that is left of the gains that the margins would
        permit, 1 where these were proved.
    """

    loop: ControlLoop
    sets: tuple[GainSet, ...]
    proof: SwitchingProof
    lowered: float = 1.0

    def __repr__(self) -> str:
        low, high = self.delays
        return f"<GainSchedule: {len(self.sets)} sets of gains for delays of {low:g} to {high:g} s>"

    @property
    def delays(self) -> tuple[float, float]:
        """The whole range of the delay, s."""
        return self.sets[-1].delays

    @property
    def robust(self) -> GainSet:
        """The gains for the whole range."""
        return self.sets[-1]

    def follow(
        self, dwell: float = 3.0, hysteresis: float = 0.01, rate: float = 0.02
    ) -> GainFollower:
        """Return what chooses a set from the interval of the delay during a run.

        Parameters
        ----------
        dwell : float
            Time for which a faster set must have been permitted before it is taken, s. A slower one
            is taken at once.
        hysteresis : float
            A faster set is taken only where the interval is inside that of the set by so much, s.
        rate : float
            Largest change of the delay, s per s. The interval is widened by the change that is
            possible until a command has been obeyed.

        Returns
        -------
        GainFollower
        """
        return GainFollower(
            tuple(gain_set.delays for gain_set in self.sets),
            self.proof.sample_time,
            dwell=dwell,
            hysteresis=hysteresis,
            rate=rate,
        )

    def summary(self) -> str:
        """The sets and what is proved, in a few lines.

        Returns
        -------
        str
        """
        lines = [
            f"{len(self.sets)} sets of gains. The schedule uses the fastest set that the delay "
            "allows:"
        ]
        for gain_set in self.sets:
            gains = ", ".join(f"{name} = {value:.4g}" for name, value in gain_set.gains.items())
            low, high = gain_set.delays
            lines.append(f"  delay {low:.4g} to {high:.4g} s: {gains}")
        low, high = self.proof.gain
        over = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        lines.append(
            "One quadratic form proves that the loop stays stable while delay and gains change "
            f"at any time, if the gain of the plant is {over}"
        )
        if self.proof.decay > 0.0:
            lines.append(
                "away from the limit, the response decays at least as fast as "
                f"e^(-{self.proof.decay:g} t)"
            )
        if self.proof.limit is not None:
            lines.append(
                f"with the limit of {self.proof.limit:g}, the proof is for steps from rest of "
                f"up to {self.proof.step:.3g}"
            )
        if self.lowered < 1.0:
            lines.append(
                "for gains with equal margins no proof was found, so the gains were moved "
                f"towards the robust gains, to {100.0 * self.lowered:.0f} % of the way"
            )
        return "\n".join(lines)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the gains over the delay; needs matplotlib.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; default is a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from deadtime._base.drawing import shown_axes
        from deadtime.tuning.adaptive._plots import plot_schedule

        axes = shown_axes(ax)
        plot_schedule(axes, self)
        return axes


def adaptive_gains(
    loop: ControlLoop | DelayEstimate | Design,
    delays: tuple[float, float],
    *,
    gain: tuple[float, float] | None = None,
    sets: int = 6,
    step: float = 1.0,
    decay: float = 0.0,
    objective: ObjectiveName = "abscissa",
    gain_margin: float = 2.5,
    level: float = 0.95,
    progress: Stages = False,
) -> GainSchedule:
    r"""Design gains that follow the delay, with a proof that they are stable while it moves.

    The robust gains are those of `design` for the whole range. For the part of the range up to some
    delay both gains are larger by the factor by which the gain margin is larger there. Then one
    quadratic form is searched that decreases for all delays and sets in any order; if there is none
    the factors are lowered until there is one. Without one nothing is returned.

    Parameters
    ----------
    loop : ControlLoop, DelayEstimate or Design
        A sampled loop. The gains of a design are taken as the robust ones; for a loop, which needs
        no delay, and for an estimate they are designed, of the kind that its controller is.
    delays : (float, float)
        The range of the delay, s; it is widened to whole samples.
    gain : (float, float), optional
        Interval of the plant's gain; of an estimate its confidence interval, else the loop's own.
    sets : int
        Number of sets, from 1 to 8; fewer where the range has fewer samples.
    step : float
        Step of the reference from rest that is to be proved with the limit of the loop.
    decay : float
        Decay to be proved, 1/s.
    objective, gain_margin
        As in `design`.
    level : float
        Probability of the interval of an estimate's gain.
    progress : bool or callable
        Called with the name of each stage as it begins, or True to print the names on stderr.

    Returns
    -------
    GainSchedule

    Raises
    ------
    NotProvedError
        If no form was found for the robust gains alone.
    ValueError
        If the loop is not sampled, its plant is more than an integrator with one lag, its
        controller neither P nor PV, or its range too long.
    MissingExtraError
        If clarabel is not installed.

    Examples
    --------
    >>> import deadtime as dtm
    >>> from deadtime.tuning import adaptive_gains
    >>> loop = dtm.ControlLoop(dtm.Integrator(0.9), dtm.P(1.0), sample_time=0.1, limit=1.0)
    >>> schedule = adaptive_gains(loop, (0.1, 0.4), sets=3)
    >>> print(schedule.summary())
    3 sets of gains. The schedule uses the fastest set that the delay allows:
    ...
    """
    count = whole_number("sets", sets, least=1)
    if count > MOST_SETS:
        raise ValueError(
            f"sets={count}: give at most {MOST_SETS}, because a few sets are nearly as good"
        )
    low, high = interval("delays", delays)
    if low < 0.0:
        raise ValueError(f"delays={delays!r}: give delays of zero or more")
    report = stage_report(progress)
    held, plant_gain = loop_and_gain(loop, gain, level)
    period = sample_time_of(held)
    first, last = math.floor(low / period + _WHOLE), math.ceil(high / period - _WHOLE)
    claims = claimed(held, plant_gain, non_negative("decay", decay))
    states = len(claims.den) - 1 + (2 if claims.filter else 0) + last
    if states > MOST_STATES:
        raise ValueError(
            f"delays={delays!r} s are up to {last} samples of {period:g} s, so the proof would "
            f"need {states} states, but at most {MOST_STATES} are possible. Give a longer "
            "sample time, or a shorter range of delays"
        )
    if not isinstance(loop, Design):
        report("designing the robust gains")
        held = _designed(held, (first * period, last * period), plant_gain, objective, gain_margin)
        claims = claimed(held, plant_gain, claims.decay)
    robust = held.replace(delay=last * period)
    ends = _ends(first, last, count)
    ages = tuple((first, end) for end in ends)
    factors = _factors(robust, first, ends)
    found, share = _proved(replace(claims, ages=ages), factors, positive("step", step), report)
    gains = robust.controller.gains
    return GainSchedule(
        robust,
        tuple(
            GainSet(
                factor,
                {name: factor * value for name, value in gains.items()},
                (first * period, end * period),
            )
            for factor, end in zip(found.factors, ends, strict=True)
        ),
        SwitchingProof(**{field.name: getattr(found, field.name) for field in fields(Claims)}),
        share,
    )


def _designed(
    loop: ControlLoop,
    delays: tuple[float, float],
    gain: tuple[float, float],
    objective: ObjectiveName,
    gain_margin: float,
) -> ControlLoop:
    """The loop with the gains for a whole range, designed with a continuous filter."""
    controller = loop.controller
    smooth = getattr(controller, "filter", None)
    template = controller
    if smooth is not None:
        template = with_filter(controller, replace(smooth, discretisation=None))
    best = design(
        loop.replace(controller=template),
        controller=template,
        delay=delays,
        gain=gain,
        objective=objective,
        gain_margin=gain_margin,
    )
    return loop.replace(controller=controller, **best.gains)


def _ends(first: int, last: int, count: int) -> tuple[int, ...]:
    """Longest delays of the sets in samples, rising in about equal ratios."""
    shortest = min(first + 1, last)
    points = np.geomspace(shortest, last, count) if count > 1 else [last]
    return tuple(sorted({round(float(point)) for point in points}))


def _factors(robust: ControlLoop, first: int, ends: Sequence[int]) -> tuple[float, ...]:
    """By how much the gain margin up to each delay is larger than up to the last."""
    period = robust.sample_time or 0.0
    samples = np.arange(first, ends[-1] + 0.25, 0.5)
    margins = [robust.replace(delay=k * period).margin().gain_margin for k in samples.tolist()]
    least = np.minimum.accumulate(margins)
    if not (math.isfinite(least[0]) and least[-1] > 1.0):
        raise NotProvedError(
            f"over this range of delays, the robust gains have gain margins of {least[-1]:.3g} "
            f"to {least[0]:.3g}: design the gains with a gain_margin, or give a shorter range"
        )
    return tuple(float(least[samples <= end][-1] / least[-1]) for end in ends)


def _proved(
    claims: Claims,
    factors: Sequence[float],
    step: float,
    report: Callable[[str], object],
) -> tuple[Claims, float]:
    """The claims with a form and the largest factors for which there is one, and their share."""

    def attempt(share: float) -> Claims | None:
        report(f"searching for a proof with the faster gains reduced to {100.0 * share:.0f} %")
        lowered = tuple(1.0 + share * (factor - 1.0) for factor in factors)
        return _attempt(replace(claims, factors=lowered), step)

    found = attempt(1.0)
    if found is not None:
        return found, 1.0
    found, share, refused = attempt(0.0), 0.0, 1.0
    if found is None:
        raise NotProvedError(
            f"no proof was found for the robust gains Kp = {claims.Kp:.4g}, Kv = "
            f"{claims.Kv:.4g}, if the delay varies from {claims.ages[-1][0]} to "
            f"{claims.ages[-1][1]} samples"
            + ("" if claims.limit is None else f" and steps of {step:g}")
            + ". Give a larger gain_margin, a shorter range, a smaller decay or smaller steps"
        )
    for _ in range(_HALVINGS):
        middle = 0.5 * (share + refused)
        better = attempt(middle)
        if better is None:
            refused = middle
        else:
            found, share = better, middle
    return found, share


def _attempt(claims: Claims, step: float) -> Claims | None:
    """The claims with a form for a step, the limit reducing the gains no more than needed."""
    if claims.limit is None:
        return proved(replace(claims, least_factor=min(claims.factors)))
    needed = claims.limit / (abs(claims.Kp) * step)
    for share in _SHARES:
        least = min(share * needed, min(claims.factors))
        found = proved(replace(claims, least_factor=least))
        if found is None or found.step >= step:
            return found
    return None
