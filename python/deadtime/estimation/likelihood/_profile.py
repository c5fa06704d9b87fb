"""Intervals of the profile likelihood, as the kernel finds them, by the names of an estimate."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.frozen import PickledByFields
from deadtime.estimation._native import FlightProfile, PlantNumbers
from deadtime.estimation.likelihood._flight import NoiseFit

#: Level of the intervals with which a search for likelier fits goes.
LEVEL = 0.95


@dataclass(frozen=True, eq=False)
class LikelihoodProfile(PickledByFields):
    """The profile of one fit.

    Attributes
    ----------
    fit : NoiseFit
    names : mapping of str to str
        The kernel's name of each quantity.
    """

    fit: NoiseFit
    names: Mapping[str, str]
    preferred: str = "the noise is fitted"
    #: Whether the commands are given, not functions of the plant that is fitted.
    commands_given: ClassVar[bool] = True
    _ends: dict[tuple[str, float], tuple[float, float]] = field(default_factory=dict)

    @classmethod
    def best(
        cls, fit: NoiseFit, names: Mapping[str, str], first: Iterable[str]
    ) -> LikelihoodProfile:
        """The profile, or that of a better minimum which the intervals of `first` find."""
        first = tuple(first)
        native = _profile(fit, names, first)
        found = cls(NoiseFit.of(fit.model, fit.runs, native.fit), names)
        found.__dict__["native"] = native
        if not native.is_long:
            for name in first:
                found.interval(name, 0.0, 0.0, LEVEL)
        return found

    @cached_property
    def native(self) -> FlightProfile:
        """The profile of the kernel."""
        return self._native()

    def _native(self) -> FlightProfile:
        return _profile(self.fit, self.names)

    @property
    def centre(self) -> PlantNumbers:
        """The fit with its gain, from which one quantity is moved."""
        return self.fit.with_gain

    @property
    def initial_output(self) -> float:
        """The fitted output at the start of the first recording; not a number where it is given."""
        runs = self.fit.runs
        if not runs[0].offset:
            return math.nan
        return self.fit.parts[0].linear["gain" in self.fit.model.names and len(runs) == 1]

    @property
    def common(self) -> Array:
        """Covariance of the common numbers, for the fitted noise."""
        return self.fit.covariance

    @cached_property
    def bounds(self) -> dict[str, float]:
        """Standard errors for the fitted noise."""
        return self._known(0)

    @cached_property
    def stderr(self) -> dict[str, float]:
        """Standard errors for the fitted noise, and for air that may be there unseen."""
        return {name: one * math.sqrt(self.unseen[name]) for name, one in self.bounds.items()}

    @cached_property
    def unseen(self) -> dict[str, float]:
        """Factor on the variance of each quantity for air that is too weak to be seen."""
        return self._known(1)

    @cached_property
    def freedom(self) -> dict[str, float]:
        """Degrees of freedom of the variance of each quantity."""
        return self._known(2)

    def _known(self, place: int) -> dict[str, float]:
        return {name: one[place] for name, one in zip(self.names, self.native.known, strict=True)}

    def freedom_of(self, name: str) -> float:
        """Degrees of freedom of the quantile for a quantity."""
        return self.freedom[name]

    def statistic(self, name: str, value: float) -> float:
        """The squared t for which `value` is the end of an interval."""
        return self.native.statistic(self.names[name], value)

    def interval(self, name: str, value: float, stderr: float, level: float) -> tuple[float, float]:
        """Ends of the interval around the fitted `value`; long recordings: from the curvature."""
        key = (name, level)
        if key not in self._ends:
            self._ends[key] = self.native.interval(self.names[name], level)
        return self._ends[key]


def _profile(fit: NoiseFit, names: Mapping[str, str], first: Iterable[str] = ()) -> FlightProfile:
    try:
        return fit.native.profile(list(names.values()), [names[name] for name in first], LEVEL)
    except NotIdentifiableError:
        raise NotIdentifiableError(
            f"{', '.join(fit.model.names)} cannot be told apart by this recording: give the plant "
            "fewer lags, or let deadtime.estimation.choose_plant choose"
        ) from None
