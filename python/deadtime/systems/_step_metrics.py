"""Rise, settling, overshoot and peak of a step response, found between its output times too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deadtime._base.arrays import Array, Mask

# Points in one magnification around an extremum or a crossing, and how often to magnify: the
# place is then known to 1e-8 of the output step, the height of a peak to rounding.
_POINTS = 101
_MAGNIFICATIONS = 4


@dataclass(frozen=True, eq=False)
class OneSignal:
    """One output over time."""

    time: Array
    values: Array
    #: The same output at other times.
    dense: Callable[[Array], Array] | None

    def step_metrics(
        self, settling: float, rise: tuple[float, float], steady_state: float | None
    ) -> dict[str, float]:
        """Metrics between the first value and the steady state, which is the last one if None."""
        start, first = float(self.time[0]), float(self.values[0])
        if steady_state is None:
            steady_state = float(self.values[-1])
        span = steady_state - first
        nan = float("nan")
        peak_time, peak = self._greatest(np.abs)
        found = dict.fromkeys(
            ("rise_time", "settling_time", "settling_min", "settling_max"), nan
        ) | {
            "overshoot": nan,
            "undershoot": nan,
            "peak": peak,
            "peak_time": peak_time - start,
            "steady_state": steady_state,
        }
        if span == 0.0:
            return found

        def progress(outputs: Array) -> Array:
            return (outputs - first) / span

        found["overshoot"] = 100.0 * max(0.0, self._greatest(progress)[1] - 1.0)
        found["undershoot"] = 100.0 * max(0.0, self._greatest(lambda y: -progress(y))[1])
        low, high = (self._crossing(progress(self.values) >= part) for part in rise)
        if low is not None and high is not None:
            left = self._refined(low, lambda y: progress(y) >= rise[0])
            risen = self._refined(high, lambda y: progress(y) >= rise[1])
            found["rise_time"] = risen - left
            found["settling_min"] = -self._greatest(lambda y: -y, first=high)[1]
            found["settling_max"] = self._greatest(lambda y: y, first=high)[1]
        outside = np.abs(progress(self.values) - 1.0) > settling
        if not outside[-1]:
            last = self._crossing(~np.logical_or.accumulate(outside[::-1])[::-1])
            found["settling_time"] = (
                0.0
                if last is None or last == 0
                else self._refined(last, lambda y: np.abs(progress(y) - 1.0) <= settling) - start
            )
        return found

    def _greatest(self, measure: Callable[[Array], Array], first: int = 0) -> tuple[float, float]:
        """Time and value of the greatest `measure` of the output, from index `first` on."""
        values = measure(self.values[first:])
        best = int(np.argmax(values)) + first
        time, value = float(self.time[best]), float(values[best - first])
        if self.dense is None:
            return time, value
        left = float(self.time[max(best - 1, first)])
        right = float(self.time[min(best + 1, len(self.time) - 1)])
        for _ in range(_MAGNIFICATIONS):
            times = np.linspace(left, right, _POINTS)
            values = measure(self.dense(times))
            best = int(np.argmax(values))
            if values[best] > value:
                time, value = float(times[best]), float(values[best])
            left, right = times[max(best - 1, 0)], times[min(best + 1, _POINTS - 1)]
        return time, value

    @staticmethod
    def _crossing(reached: Mask) -> int | None:
        """Index of the first output for which `reached` holds."""
        return int(np.argmax(reached)) if reached.any() else None

    def _refined(self, index: int, reached: Callable[[Array], Mask]) -> float:
        """Return the time between outputs `index` - 1 and `index` from which `reached` holds."""
        right = float(self.time[index])
        if index == 0 or self.dense is None:
            return right
        left = float(self.time[index - 1])
        for _ in range(_MAGNIFICATIONS):
            times = np.linspace(left, right, _POINTS)
            holds = reached(self.dense(times))
            holds[-1] = True
            # The last stretch that holds to the end: a settling band may be left and entered
            # between two outputs.
            held = int(np.argmin(holds[::-1])) if not holds.all() else _POINTS
            right = float(times[_POINTS - held])
            left = float(times[max(_POINTS - held - 1, 0)])
        return right
