"""What a design may choose, and what it does not know: free gains, intervals of delay and gain."""

from __future__ import annotations

import inspect
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.frozen import PickledByFields
from deadtime._base.validation import Range, finite, interval, non_negative
from deadtime.estimation import DelayEstimate
from deadtime.loops import PD, PID, PV, Controller, ControlLoop, DerivativeFilter
from deadtime.tuning._candidates import Gathered, Scenario
from deadtime.tuning._native import Candidates
from deadtime.tuning._region import ConfidenceRegion, region_of
from deadtime.tuning._stabilising import candidate_ranges

ObjectiveName: TypeAlias = Literal[
    "load",
    "load_ie",
    "set_point",
    "set_point_settling",
    "abscissa",
    "damping",
    "settling_time",
    "overshoot",
]

#: Most free gains: those of PID. More would need a search without a map.
_MOST_FREE = 3

#: Most samples in the delay. A hold moves the delay by half a sample, here by 0.03 % of itself; the
#: time of a design grows with the square of this number.
_MOST_SAMPLES = 2000


@dataclass(frozen=True, eq=False)
class Problem(PickledByFields):
    """A loop whose controller is a template: its free gains are replaced throughout.

    Attributes
    ----------
    loop : ControlLoop
        With the numbers in `intervals` at their middles.
    free : tuple of str
        Gains to be found.
    given : dict of str to (float, float) or None
        Where they are looked for, if that was given.
    intervals : dict of str to (float, float)
        ``delay`` and, where it is not known either, ``gain`` of the plant; of a region those of
        all its numbers.
    amplitude : float
        Height of the step, where steps are judged.
    threads : int or None
    region : ConfidenceRegion or None
        The scenarios in place of all combinations of the intervals.
    """

    loop: ControlLoop
    free: tuple[str, ...]
    given: dict[str, Range] | None
    intervals: dict[str, Range]
    amplitude: float
    threads: int | None
    region: ConfidenceRegion | None = None

    @cached_property
    def spans(self) -> tuple[dict[str, Range], ...]:
        """Where gains are looked for, one after the other until some of them are stable."""
        if self.given is not None:
            return (self.given,)
        if not self.loop.plant.is_rational:
            raise ValueError(
                "the search range of the gains is known only for a rational plant with one "
                "delay in series, and this plant is of another kind: give ranges="
            )
        return candidate_ranges(self.loop, self.free)

    def named(self, gains: Sequence[float] | Array) -> dict[str, float]:
        """The free gains by name."""
        return {name: float(value) for name, value in zip(self.free, gains, strict=True)}

    def at(self, gains: Sequence[float] | Array, scenario: Scenario | None = None) -> ControlLoop:
        """The loop with these gains, in one scenario or in the middle."""
        return self.loop.replace(**self.named(gains), **(scenario or {}))

    def candidates(self, scenarios: Sequence[Scenario]) -> Candidates:
        """The loops with any gains in these scenarios, for the kernel."""
        return Candidates(self.gathered.at(scenarios), self.gathered.free)

    @cached_property
    def gathered(self) -> Gathered:
        """The loops of the kernel."""
        return Gathered(self.loop, self.free)

    def filtered(self, smooth: DerivativeFilter | None) -> Problem:
        """The same problem with another filter of the derivative, or none."""
        controller = with_filter(self.loop.controller, smooth)
        found = replace(self, loop=self.loop.replace(controller=controller))
        # Where gains are looked for follows from proportional control, which has no filter.
        vars(found)["spans"] = self.spans
        return found

    def scenarios(self, points: int) -> tuple[Scenario, ...]:
        """Every combination of `points` values of each unknown number."""
        values = [
            np.linspace(low, high, points) if low < high else [low]
            for low, high in self.intervals.values()
        ]
        return tuple(
            dict(zip(self.intervals, map(float, some), strict=True))
            for some in itertools.product(*values)
        )

    @cached_property
    def corners(self) -> tuple[Scenario, ...]:
        """Ends and middle of each interval, or the extremes of the region."""
        if self.region is not None:
            return (self.region.estimate, *self.region.extremes)
        return self.scenarios(3)

    @cached_property
    def middle(self) -> Scenario:
        """All numbers in the middles of their intervals, or as they were estimated."""
        if self.region is not None:
            return self.region.estimate
        return {name: 0.5 * (low + high) for name, (low, high) in self.intervals.items()}

    @property
    def delays(self) -> tuple[float, ...]:
        """Ends and middle of the delay's interval."""
        low, high = self.intervals["delay"]
        return (low, self.middle["delay"], high) if low < high else (low,)


def pose(
    loop: object,
    template: Controller,
    delay: float | Range | None,
    gain: float | Range | None,
    fixed: Mapping[str, float] | None,
    ranges: Mapping[str, Range] | None,
    amplitude: float,
    threads: int | None,
    level: float = 0.95,
    allow_indication: bool = False,
) -> Problem:
    """Check these arguments of `design`, and state its problem."""
    region = None
    if isinstance(loop, DelayEstimate):
        if delay is not None or gain is not None:
            raise ValueError(
                "the region of the estimate already contains delay and gain: leave delay= and "
                "gain= out, or give the loop of the estimate, fit.loop"
            )
        region = region_of(loop, level, allow_indication)
        loop = loop.loop
    if not isinstance(loop, ControlLoop):
        loop, delay = _around(loop, template, delay)
    held = {name: finite(name, value) for name, value in _mapping("fixed", fixed).items()}
    unknown = [name for name in held if name not in template.gains]
    if unknown:
        raise ValueError(
            f"fixed={dict(held)}: {type(template).__name__} has no gain {unknown[0]!r}. Its "
            f"gains are {', '.join(template.gains)}"
        )
    free = tuple(name for name in template.gains if name not in held)
    if not free:
        raise ValueError(
            f"fixed contains every gain of {type(template).__name__} ({', '.join(held)}), so "
            "nothing is left to choose. Leave one gain free, or ask the loop itself for its "
            "margins"
        )
    if len(free) > _MOST_FREE:
        raise ValueError(
            f"{len(free)} gains are free ({', '.join(free)}), but at most {_MOST_FREE} can be "
            "searched: fix some of these gains"
        )
    if region is not None:
        intervals, middle = region.intervals, region.estimate
    else:
        intervals = {"delay": _delay_interval(loop, delay)}
        if gain is not None:
            intervals["gain"] = _gain_interval(gain)
        middle = {name: 0.5 * (low + high) for name, (low, high) in intervals.items()}
    whole = loop.replace(controller=template, **middle)
    if held:
        whole = whole.replace(**held)
    _refuse_too_many_samples(whole)
    spans = None
    if ranges is not None:
        given = _mapping("ranges", ranges)
        if set(given) != set(free):
            raise ValueError(
                f"ranges are given for {sorted(given)}, but the free gains are {sorted(free)}"
            )
        spans = {name: interval(f"the range of {name}", given[name]) for name in free}
    height = finite("amplitude", amplitude)
    if height == 0.0:
        raise ValueError("amplitude=0 is not a step: give a number other than zero")
    return Problem(whole, free, spans, intervals, height, threads, region)


def _refuse_too_many_samples(loop: ControlLoop) -> None:
    """Raise for a delay of so many samples that a design would take hours."""
    if loop.sample_time is None or loop.delay is None:
        return
    if loop.delay > _MOST_SAMPLES * loop.sample_time:
        raise ValueError(
            f"sample_time={loop.sample_time:g}: the delay of {loop.delay:g} s has more than "
            f"{_MOST_SAMPLES} samples. So short a hold has no effect, so leave sample_time out"
        )


def _around(
    plant: object, template: Controller, delay: float | Range | None
) -> tuple[ControlLoop, float | Range | None]:
    """A loop around a plant, and its delay: the plant's own and what comes on top of it."""
    loop = ControlLoop(plant, template)
    if delay is None or loop.delay is None:
        return loop, delay
    more = _times(delay)
    return loop, (loop.delay + more[0], loop.delay + more[1])


def controller_template(controller: type[Controller] | Controller) -> Controller:
    """A controller of the given class, whose gains are placeholders."""
    if isinstance(controller, Controller):
        return controller
    if isinstance(controller, type) and issubclass(controller, Controller):
        names = inspect.signature(controller).parameters
        return controller(**{name: 1.0 for name in names if name.startswith("K")})
    raise TypeError(
        f"controller={controller!r} is not a controller: give P, PV, PD, PI or PID, as a "
        "class or with gains"
    )


def with_filter(controller: Controller, filter: DerivativeFilter | None) -> Controller:  # noqa: A002
    """The same gains with another filter of the derivative, or none."""
    if not isinstance(controller, (PV, PD, PID)):
        raise ValueError(
            f"{type(controller).__name__} has no derivative that could be filtered: use PV, PD "
            "or PID, or leave filter out"
        )
    return type(controller)(**controller.gains, filter=filter)


def _mapping(name: str, given: Any) -> dict[str, Any]:
    """What was given by name, as a dict of its own."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        value = "(0.0, 5.0)" if name == "ranges" else "2.0"
        raise TypeError(f"{name}={given!r}: give a dict such as {{'Kp': {value}}}")
    return dict(given)


def _delay_interval(loop: ControlLoop, delay: float | Range | None) -> Range:
    if delay is None:
        if loop.delay is None:
            raise ValueError(
                "the delay of the loop is not known: give delay=, or estimate the delay"
            )
        return loop.delay, loop.delay
    return _times(delay)


def _times(delay: float | Range) -> Range:
    """One delay or an interval of delays, s."""
    if not isinstance(delay, (tuple, list, np.ndarray)):
        return non_negative("delay", delay), float(delay)
    low, high = interval("delay", delay, may_be_point=True)
    if low < 0.0:
        raise ValueError(
            f"delay={delay!r}: give an interval (low, high) of times, all zero or more"
        )
    return low, high


def _gain_interval(gain: float | Range) -> Range:
    if not isinstance(gain, (tuple, list, np.ndarray)):
        gain = (gain, gain)
    low, high = interval("gain", gain, may_be_point=True)
    if low * high <= 0.0:
        raise ValueError(
            f"gain={gain!r}: give an interval (low, high) of gains, both positive or both negative"
        )
    return low, high
