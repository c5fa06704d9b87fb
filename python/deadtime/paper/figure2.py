"""Figure 2: simulated and measured step responses of the Internet loop, and their time scales.

The figure prints no numbers. Here the loop of section 2.1 runs in virtual time, and its delay is
estimated from the overshoots as in Table 1. The paper leaves open why the time scales of simulation
and experiment differ; this is answered as far as its data allow.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

import deadtime as dtm
from deadtime.paper.internet_loop import internet_loop
from deadtime.paper.part import Grid, Part
from deadtime.paper.table1 import PRINTED_OVERSHOOTS
from deadtime.paper.time_scales import Explanation, Stretch, explain, stretch, time_scale
from deadtime.systems import Response

#: Round trip of the simulated loops, s: that of Figure 3.
DELAY = 0.1

#: Holds and lags beside the delay, s.
HOLDS, LAGS = (0.02, 0.05, 0.1, 0.15), (0.02, 0.05, 0.1)

#: Seeds of the loops whose round trips vary.
SEEDS = 20


@dataclass(frozen=True)
class Scenario:
    """A network in virtual time.

    Attributes
    ----------
    words : str
        Description.
    sample_time, jitter : float
        As in `internet_loop`, s.
    """

    words: str
    sample_time: float
    jitter: float = 0.0


SCENARIOS = (
    Scenario("packets every 10 ms", 0.01),
    Scenario("every 50 ms", 0.05),
    Scenario("every 10 ms, jitter 20 ms", 0.01, 0.02),
)


@dataclass(frozen=True, eq=False)
class Trial:
    """The delay from the overshoot of a loop with known round trip, as in Table 1.

    Attributes
    ----------
    gain : float
        K, 1/s.
    scenario : Scenario
        The network.
    recording : Recording
        Of the first seed.
    delays : ndarray
        Estimates by the dominant root, one for each seed, s.
    """

    gain: float
    scenario: Scenario
    recording: dtm.Recording
    delays: np.ndarray


@dataclass(frozen=True, eq=False)
class Figure2(Part):
    """Figure 2, in virtual time, and the answer to its question.

    Attributes
    ----------
    simulated : dict of float to Response
        The loop of a delay of 0.1 s alone, for each K.
    trials : tuple of Trial
        The same over the network, for each scenario and K.
    stretches : tuple of Stretch
        Time scales with a hold or a lag, at the overshoots of Table 1.
    explanations : tuple of Explanation
        Fits of all overshoots by delay and hold, by delay and lag, and by all three, the hold
        being that of the first.
    fitted : tuple of Stretch
        Time scales of the loop of the best fit by a hold.
    comparisons : tuple of Comparison
        None: the figure prints no numbers.
    """

    simulated: dict[float, Response]
    trials: tuple[Trial, ...]
    stretches: tuple[Stretch, ...]
    explanations: tuple[Explanation, ...]
    fitted: tuple[Stretch, ...]

    def grids(self) -> tuple[Grid, ...]:
        """Estimates over the network, time scales, and what explains Table 1."""
        return (self._estimates(), self._time_scales(), self._fits())

    def _estimates(self) -> Grid:
        gains = sorted(self.simulated)
        rows = []
        for gain in gains:
            cells = [f"{gain:g}"]
            for scenario in SCENARIOS:
                (trial,) = (
                    case for case in self.trials if case.gain == gain and case.scenario == scenario
                )
                cells.append(_in_ms(trial.delays))
            rows.append(tuple(cells))
        return Grid(
            f"Delay by the method of Table 1, with a round trip of {1e3 * DELAY:g} ms",
            ("K", *(scenario.words for scenario in SCENARIOS)),
            tuple(rows),
        )

    def _time_scales(self) -> Grid:
        kinds = [(hold, 0.0) for hold in HOLDS] + [(0.0, lag) for lag in LAGS]
        rows = []
        for hold, lag in kinds:
            found = [case for case in self.stretches if (case.hold, case.lag) == (hold, lag)]
            rows.append(
                (
                    f"hold {1e3 * hold:g} ms" if hold else f"lag {1e3 * lag:g} ms",
                    _span(case.period_ratio for case in found),
                    _span(case.peak_ratio for case in found),
                    _span((case.delay for case in found), " s"),
                    ", ".join(f"{case.gain:g}" for case in found),
                )
            )
        return Grid(
            "Period and first peak at the same K and overshoot, relative to a delay alone",
            ("with", "period", "first peak", "remaining delay", "K"),
            tuple(rows),
        )

    def _fits(self) -> Grid:
        rows = []
        for fit in self.explanations:
            for row in sorted({0, fit.best, len(fit.values) - 1}):
                rows.append(
                    (
                        fit.words if row else "delay and hold" if fit.hold else "delay alone",
                        f"{1e3 * (fit.values[row] if row else fit.hold):.0f} ms",
                        f"{1e3 * fit.delays[row]:.0f} ms",
                        f"{fit.misfits[row]:.1f} points",
                        " ".join(f"{value:.0f}" for value in fit.overshoots[row]),
                    )
                )
        measured = " ".join(f"{value:.0f}" for value in PRINTED_OVERSHOOTS.values())
        return Grid(
            "One loop for all six overshoots of Table 1",
            ("model", "value", "delay", "misfit (rms)", f"overshoots (measured {measured})"),
            tuple(dict.fromkeys(rows)),
        )

    def findings(self) -> tuple[str, ...]:
        """The answer to the question of Figure 2, and its limits."""
        hold, lag, both = self.explanations
        held = [case.period_ratio for case in (*self.stretches, *self.fitted) if case.hold > 0.0]
        return (
            "With a delay alone, K and the overshoot determine the period. So another period "
            "at the same K and overshoot proves a second time constant in the loop.",
            f"A hold has a small effect. With a hold of {1e3 * HOLDS[-1]:g} ms the period is "
            f"{_span(self._periods(hold=HOLDS[-1]))} times as long, and the first peak may even "
            f"come earlier. A lag has a large effect: with a lag of {1e3 * LAGS[-1]:g} ms the "
            f"period is {_span(self._periods(lag=LAGS[-1]))} times as long.",
            "The overshoots of Table 1 indicate a hold, but not a lag. One delay for all gains "
            f"leaves an error of {hold.misfits[0]:.1f} points. A hold of "
            f"{1e3 * hold.values[hold.best]:.0f} ms with a delay of "
            f"{1e3 * hold.delays[hold.best]:.0f} ms leaves {hold.misfits[hold.best]:.1f} "
            f"points, with a period {_span(fit.period_ratio for fit in self.fitted)} times as "
            f"long. Every lag increases the error, to {lag.misfits[-1]:.1f} points at "
            f"{1e3 * lag.values[-1]:.0f} ms. With that hold, a lag also increases the error "
            f"({both.misfits[-1]:.1f} points at {1e3 * both.values[-1]:.0f} ms). The minimum "
            "over the hold is narrow, so it does not prove a hold of that length.",
            f"So for these overshoots, a hold explains periods {_span(held)} times as long as "
            "with a delay alone. Longer periods need a lag, which Table 1 contradicts, or a "
            "model clock that does not run in real time. A clock at a rate c stretches all "
            "times by 1/c, and the overshoot is then that of c K Td.",
            "The paper's data do not decide between these two. The paper prints no peak time, "
            "no sample time of the two computers and no round trip. In Table 1 the delay rises "
            "from 0.09 to 0.13 s. The method does not cause this rise: at a constant round "
            f"trip, its estimates rise only by {1e3 * self._rise():.1f} ms from K = 5 to 10. "
            "Another explanation is that the runs were made at different hours, with round "
            "trips that differ by a third.",
            "With a jitter of 20 ms and the newest answer in use, the effective delay is "
            f"{1e3 * self._won():.0f} ms shorter than with a constant round trip.",
        )

    def _periods(self, hold: float = 0.0, lag: float = 0.0) -> list[float]:
        return [
            case.period_ratio for case in self.stretches if (case.hold, case.lag) == (hold, lag)
        ]

    def _means(self, scenario: Scenario) -> list[float]:
        return [float(case.delays.mean()) for case in self.trials if case.scenario == scenario]

    def _rise(self) -> float:
        """Estimate at the largest gain minus that at the smallest, s."""
        steady = self._means(SCENARIOS[0])
        return steady[-1] - steady[0]

    def _won(self) -> float:
        """By how much estimates are shorter where answers overtake each other, s."""
        return float(np.mean(self._means(SCENARIOS[0])) - np.mean(self._means(SCENARIOS[2])))


def figure2() -> Figure2:
    """Run the Internet loop for K from 5 to 10, and find what changes its time scale.

    Returns
    -------
    Figure2

    Examples
    --------
    >>> from deadtime import paper
    >>> found = paper.figure2()
    >>> [trial.gain for trial in found.trials if trial.scenario.jitter]
    [5.0, 6.0, 7.0, 8.0, 9.0, 10.0]
    """
    gains = [float(gain) for gain in PRINTED_OVERSHOOTS]
    time = np.linspace(0.0, 3.0, 601)
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1.0), delay=DELAY)
    kinds = [{"hold": hold} for hold in HOLDS] + [{"lag": lag} for lag in LAGS]
    stretches = (
        stretch(float(gain), percent, **kind)
        for kind in kinds
        for gain, percent in PRINTED_OVERSHOOTS.items()
    )
    held = explain("hold", np.arange(0.005, 0.2001, 0.005))
    longest = float(held.values[held.best])
    explanations = (
        held,
        explain("lag", np.arange(0.01, 0.1001, 0.01)),
        explain("lag", np.array([0.005, 0.01, 0.02, 0.03, 0.04]), hold=longest),
    )
    best = loop.replace(delay=float(held.delays[held.best]), sample_time=longest)
    return Figure2(
        simulated={gain: loop.replace(Kp=gain).simulate(time) for gain in gains},
        trials=tuple(_trial(gain, scenario) for scenario in SCENARIOS for gain in gains),
        stretches=tuple(case for case in stretches if case is not None),
        explanations=explanations,
        fitted=tuple(time_scale(best.replace(Kp=gain)) for gain in gains),
    )


def _trial(gain: float, scenario: Scenario) -> Trial:
    known = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=gain), sample_time=scenario.sample_time)
    recordings = [
        internet_loop(
            gain,
            DELAY,
            sample_time=scenario.sample_time,
            jitter=scenario.jitter,
            seed=seed,
            duration=3.0,
        )
        for seed in range(SEEDS if scenario.jitter else 1)
    ]
    delays = [dtm.estimate_delay(record, known, method="overshoot").delay for record in recordings]
    return Trial(gain, scenario, recordings[0], np.array(delays))


def _in_ms(delays: np.ndarray) -> str:
    middle = f"{1e3 * delays.mean():.1f}"
    return f"{middle} ms" if delays.size == 1 else f"{middle} ± {1e3 * delays.std(ddof=1):.1f} ms"


def _span(values: Iterable[float], unit: str = "") -> str:
    numbers = sorted(values)
    low, high = numbers[0], numbers[-1]
    digits = 3 if unit else 2
    return f"{low:.{digits}f} to {high:.{digits}f}{unit}"
