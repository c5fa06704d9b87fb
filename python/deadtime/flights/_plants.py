"""Plants for flights by evidence: from an integrator with a lag to what shapes commands as well.

The plants are tried in order until one explains the flights: an integrator with a lag; that behind
the limits of acceleration and jerk within which the vehicle follows its commands, by its own
parameters where it tells them, else with a limit of acceleration that is fitted; and, to the sides
and behind known limits, two lags and a zero, because the controller of a horizontal velocity
overshoots. If none explains them, the closest of those with the fewest numbers is taken, and its
estimate is an indication.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation import DelayEstimate, OutputError, estimate_delay
from deadtime.flights._arrivals import error_of_mean
from deadtime.flights._runs import FlownSteps
from deadtime.links.axes import Axis
from deadtime.loops import (
    ControlLoop,
    FactoredPlant,
    Integrator,
    ParametricPlant,
    Plant,
    RateLimited,
)

#: Largest rate of change of a command, and largest rate of that where it has one.
Shaping: TypeAlias = tuple[float, float | None]

#: Where the searches begin: lags and zero, s, and the limit of an acceleration, 1/s².
LAG, LAGS, ZERO, RATE = 0.1, (0.15, 0.1), 0.2, 1.0

USUAL = ("delay", "gain", "lag")


@dataclass(frozen=True)
class TriedPlant:
    """A plant that was fitted to the flights.

    Attributes
    ----------
    words : str
        The plant in words.
    fit : DelayEstimate or None
        Its estimate.
    refused : str
        Why there is none; empty where there is one.
    """

    words: str
    fit: DelayEstimate | None
    refused: str = ""

    def line(self, unit: str) -> str:
        """How the fit came out, in thousandths of the unit of the output."""
        if self.fit is None:
            return f"{self.words}: {self.refused}"
        return f"{self.words}: {self.fit.verdict}, residuals of {1e3 * self.fit.rms:.1f} {unit}"


def candidates(axis: Axis, shaping: Shaping | None) -> Iterator[tuple[str, Plant, tuple[str, ...]]]:
    """The plants in words, and what is fitted of each."""
    yield "an integrator with a lag", Integrator(1.0, lag=LAG), USUAL
    if shaping is None:
        limited = RateLimited(Integrator(1.0, lag=LAG), RATE)
        yield "an integrator with a lag and a limit of acceleration", limited, (*USUAL, "rate")
        return
    rate, jerk = shaping
    limits = f"an acceleration of {rate:g}" + ("" if jerk is None else f" and a jerk of {jerk:g}")
    yield (
        f"an integrator with a lag and the limits of the vehicle, {limits}",
        RateLimited(Integrator(1.0, lag=LAG), rate, jerk),
        USUAL,
    )
    if axis.command not in ("north", "east"):
        return
    overshoots = FactoredPlant(LAGS, zero=ZERO, integrator=True)
    yield (
        "an integrator with two lags, a zero and the limits of the vehicle",
        RateLimited(overshoots, rate, jerk),
        ("delay", "gain", "lag_1", "lag_2", "zero"),
    )


def fit_by_evidence(
    flights: Sequence[FlownSteps],
    largest: float,
    shaping: Shaping | None,
    progress: Callable[[str], object] = lambda stage: None,
) -> tuple[DelayEstimate, tuple[TriedPlant, ...]]:
    """The estimate with the first plant that explains the flights, or with the closest one.

    Parameters
    ----------
    flights : sequence of FlownSteps
        Of one axis of one vehicle.
    largest : float
        Limit of the commands.
    shaping : (float, float or None) or None
        The limits of the vehicle, where it tells them.
    progress : callable
        Called with the plant that is tried, after the first.

    Raises
    ------
    NotIdentifiableError
        If no plant has an estimate; the message is that of the first.
    """
    tried: list[TriedPlant] = []
    left_open = error_of_mean([flight.effects for flight in flights if flight.effects is not None])
    for words, plant, free in candidates(flights[0].axis, shaping):
        if tried:
            progress(f"trying {words}")
        loops = [
            ControlLoop(plant, flight.controller, sample_time=flight.sample_time, limit=largest)
            for flight in flights
        ]
        try:
            # From the middle of the rest before the first step, where the effect of what was flown
            # before has decayed and the earlier commands are known.
            fit = estimate_delay(
                [flight.measured for flight in flights],
                loops,
                method=OutputError(rivals=False),
                free=free,
                window=[(0.5 * flight.settle, None) for flight in flights],
            )
        except NotIdentifiableError as error:
            tried.append(TriedPlant(words, None, str(error)))
            continue
        fit = fit.with_error_beside(left_open)
        tried.append(TriedPlant(words, fit))
        if fit.verdict == "reliable":
            break
    found = [trial.fit for trial in tried if trial.fit is not None]
    if not found:
        raise NotIdentifiableError(tried[0].refused)
    if found[-1].verdict == "reliable":
        return found[-1], tuple(tried)
    # More numbers leave smaller residuals in any case.
    fewest = min(len(fit.free) for fit in found)
    closest = min((fit for fit in found if len(fit.free) == fewest), key=lambda fit: fit.rms)
    return closest, tuple(tried)


def lag_of_limits(fit: DelayEstimate) -> float:
    """Time constant with which small commands are followed within the limits of the plant, s."""
    plant = fit.loop.plant
    if not isinstance(plant, RateLimited) or plant.rate_of_rate is None:
        return 0.0
    return plant.rate / plant.rate_of_rate


def for_small_commands(fit: DelayEstimate) -> DelayEstimate:
    """The estimate with a linear plant, for a design: without its limits, but with their lag.

    A command that stays below the limit of acceleration is followed with the time constant
    acceleration/jerk.
    """
    limited = fit.loop.plant
    if not isinstance(limited, RateLimited):
        return fit
    inner = limited.plant
    shaped = lag_of_limits(fit)
    numbers = {name: value for name, value in inner.parameters.items() if name != "gain"}

    def polynomials(**values: Any) -> tuple[list[Any], list[Any]]:
        num, den = inner._polynomials({**inner.parameters, **values, "gain": 1.0})
        if shaped:
            den = [
                slow + fast
                for slow, fast in zip(
                    [*(shaped * coefficient for coefficient in den), 0.0], [0.0, *den], strict=True
                )
            ]
        return list(num), list(den)

    linear = ParametricPlant(polynomials, numbers, inner.parameters["gain"])
    return replace(fit, loop=fit.loop.replace(plant=linear))
