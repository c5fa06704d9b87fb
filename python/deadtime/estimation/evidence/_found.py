"""What is found in a recording, in words: kinds of plant, what they lack, what a sensor did."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import deadtime.estimation._native as native
from deadtime._base.digits import shown, time_unit
from deadtime._base.frozen import ReadOnlyArrays
from deadtime.loops import PAIR, FactoredPlant, FirstOrder, Integrator, Plant, RationalPlant

#: Lead in BIC from which a plant explains a recording clearly better: 10 is "very strong" of Kass
#: and Raftery (1995). Smaller: the second is ruled out by chance; larger: hulls are wider.
CLEAR = 10.0


@dataclass(frozen=True, eq=False)
class PlantCandidate(ReadOnlyArrays):
    """A kind of plant that was tried, with its most likely numbers.

    Attributes
    ----------
    name : str
        The kind, such as ``"two lags"``.
    delay : float
        Dead time, s.
    plant : Plant
        The plant without the dead time.
    parameters : dict of str to float
        Its numbers: ``delay``, ``gain``, and those of ``lag_1``, ``lag_2``, ``zero``,
        ``pole_frequency`` and ``pole_damping`` that it has. Times in s, frequency in rad/s.
    behind : float
        By how much it is behind the best in the Bayesian information criterion (BIC): 10 is clear.
    determined : int
        How many of its numbers the recording determines.
    noise_std : float
        Standard deviation of what it leaves unexplained, in the unit of the output.
    """

    name: str
    delay: float
    plant: Plant
    parameters: dict[str, float]
    behind: float
    determined: int
    noise_std: float

    @property
    def integrates(self) -> bool:
        """Whether the output ramps while the command is held."""
        return self.name.startswith("integrator")

    @property
    def lags(self) -> tuple[float, ...]:
        """Its real time constants, s, the largest first."""
        return tuple(value for name, value in self.parameters.items() if name.startswith("lag_"))

    @property
    def lag_sum(self) -> float:
        """Sum of its time constants, those of a pair of poles too, s."""
        numbers = self.parameters
        if "pole_frequency" in numbers:
            return 2.0 * numbers["pole_damping"] / numbers["pole_frequency"]
        return sum(self.lags)

    def in_words(self) -> str:
        """What the plant is, in words: "a process that comes to rest, time constant 40 s"."""
        numbers = self.parameters
        if self.name == "delay":
            return "a pure delay"
        kind = "a process that " + ("integrates" if self.integrates else "comes to rest")
        lags = [_time(lag) for lag in self.lags]
        if "pole_frequency" in numbers:
            kind += (
                f" and oscillates at {numbers['pole_frequency']:.3g} "
                f"rad/s with damping {numbers['pole_damping']:.2g}"
            )
        elif lags and self.integrates:
            kind += f", after a lag of {' and one of '.join(lags)}"
        elif lags:
            kind += f", time constant{'s' if len(lags) > 1 else ''} {' and '.join(lags)}"
        if "zero" in numbers:
            kind += f", zero {_time(numbers['zero'])}"
        return kind

    def formula(self) -> str:
        """The plant without its dead time as `--plant` of the commands takes it."""
        numbers = self.parameters
        factors = [f"({lag:.6g}*s+1)" for lag in self.lags]
        if "pole_frequency" in numbers:
            omega, damping = numbers["pole_frequency"], numbers["pole_damping"]
            factors.append(f"({omega**-2:.6g}*s*s+{2.0 * damping / omega:.6g}*s+1)")
        if self.integrates:
            factors.append("s")
        above = f"{numbers['gain']:.6g}"
        if numbers.get("zero"):
            above += f"*({numbers['zero']:.6g}*s+1)"
        below = "*".join(factors)
        return f"{above}/{below if len(factors) == 1 else f'({below})'}" if factors else above


def _time(value: float) -> str:
    """A time in the unit that suits it, with three digits."""
    unit, size = time_unit(value)
    return f"{value / size:.3g} {unit}"


def candidate_of(found: native.FamilyCandidate, best: float) -> PlantCandidate:
    """A candidate of the kernel; `best` is the least BIC."""
    plant, parameters = plant_of(found, found.values.tolist())
    behind = found.bic - best
    return PlantCandidate(
        found.plant, parameters["delay"], plant, parameters, behind, found.told, found.noise_std
    )


def plant_of(
    found: native.FamilyCandidate, values: Sequence[float]
) -> tuple[Plant, dict[str, float]]:
    """The simplest plant that has these values of the numbers of a candidate, and all of them."""
    delay, gain, lags, zero, poles = found.plant_of(values)
    pair = dict(zip(PAIR, poles or (), strict=False))
    parameters = {"delay": delay, "gain": gain}
    parameters |= {f"lag_{place}": lag for place, lag in enumerate(lags, 1)}
    parameters |= {"zero": zero} if found.has_zero else {}
    plant: Plant
    if pair or zero or len(lags) > 1:
        plant = FactoredPlant(tuple(lags), gain, zero, found.integrating, **pair)
    elif found.integrating:
        plant = Integrator(gain, *lags)
    else:
        plant = FirstOrder(gain, *lags) if lags else RationalPlant([1.0], [1.0], gain)
    return plant, parameters | pair


#: Quantile of a 95 % interval.
REACH = 1.96

#: What each cause of the kernel is called, and what it says of size and time.
WORDS = {
    "load": "a load of {size} in units of the command begins at {time}",
    "output step": "the output jumps by {size} at {time}, although the plant does not move",
    "delay change": "the delay changes by {size} s at {time}",
    "dead zone": "commands within ±{size} have no effect",
    "play": "the actuator has a backlash of {size}",
    "stiction": "the actuator sticks until the command differs from its position by {size}",
    "upper limit": "the command has no further effect above {size}",
    "lower limit": "the command has no further effect below -{size}",
    "rate limit": "the input of the plant changes by at most {size} per second",
    "slope limit": "the response of the plant changes by at most {size} of the command per second",
    "drag": "a force of {size} times the square of the speed slows the motion",
    "gain ramp": "the gain changes by {share} during the recording",
    "gain by level": "the gain changes by {share} over the range of the output",
    "jitter": "the times at which commands arrive have a standard deviation of {size} s",
}

#: What to do about each.
REMEDIES = {
    "load": "if the load can be avoided, record without the load",
    "output step": "check the sensor, or the estimator that filters it, at that time",
    "delay change": "make two estimates, with one window before the change and one after it",
    "dead zone": "compensate the dead zone in the controller, or use larger commands",
    "play": "remove the backlash, or use changes of the command much larger than the backlash",
    "stiction": "free the actuator, or use changes of the command much larger than this difference",
    "upper limit": "give the controller this limit of the command",
    "lower limit": "give the controller this limit of the command",
    "rate limit": "give the loop this limit of the command's rate",
    "slope limit": "keep commands below this limit, or give the vehicle's limits: "
    "recording.behind_limits(rate, rate_of_rate)",
    "drag": "use the gain only for speeds that occur in this recording",
    "gain ramp": "find out why the gain changes, for example with the battery or the temperature",
    "gain by level": "record around the output at which the loop has to work",
    "jitter": "log the times at which commands are sent, or send commands at a constant rate",
}

#: Both sides of a limit have one name.
NAMES = {"upper limit": "unequal limits", "lower limit": "unequal limits"}

SENSOR_WORDS = {
    "frozen": "the sensor is frozen for {rows} rows from {start:.4g} to {stop:.4g} s",
    "repeated": "{rows} rows repeat a reading that is {size:.3g} s old on average",
    "glitch": "the sensor has glitches in {rows} rows",
    "smoothed": "each reading is a centred moving mean of {size:.3g} rows",
}


@dataclass(frozen=True)
class Cause:
    """What a linear plant lacks, found in a recording.

    Attributes
    ----------
    name : str
        ``"load"``, ``"output step"``, ``"delay change"``, ``"dead zone"``, ``"play"``,
        ``"stiction"``, ``"unequal limits"``, ``"rate limit"``, ``"slope limit"``, ``"drag"``,
        ``"gain ramp"``, ``"gain by level"`` or ``"jitter"`` of the times of commands.
    size : float
        In units of the command for a load, a dead zone, play, stiction and limits; of the output
        for its step; a share for a gain that changes; s for a change of delay and for jitter.
    ci : (float, float)
        Its 95 % interval.
    time : float or None
        When it began, s; None where it was there all the time.
    lead : float
        BIC by which the recording is explained better with it.
    others : tuple of str
        Other causes that explain the recording about as well.
    """

    name: str
    size: float
    ci: tuple[float, float]
    time: float | None
    lead: float
    others: tuple[str, ...] = ()
    _kind: str = ""

    def in_words(self) -> str:
        """What it is, with its size."""
        error = (self.ci[1] - self.ci[0]) / (2.0 * REACH)
        words = WORDS[self._kind].format(
            size=shown(self.size, error),
            share=f"{shown(100.0 * self.size, 100.0 * error)} %",
            time="" if self.time is None else f"{self.time:.4g} s",
        )
        names = " or ".join((self.name, *self.others))
        likeliest = f"{names}, which the recording does not distinguish; the likeliest: {words}"
        return likeliest if self.others else words

    @property
    def remedy(self) -> str:
        """What to do about it."""
        return REMEDIES[self._kind]


@dataclass(frozen=True)
class SensorFault:
    """Rows of a recording that are no readings of the sensor.

    They are left out; from a moving mean, the readings are found back.

    Attributes
    ----------
    name : {"frozen", "repeated", "glitch", "smoothed"}
        What the sensor did.
    recording : int
        The recording, from 0 on.
    rows : int
        How many rows are concerned.
    start, stop : float
        Times of the first and the last of them, s.
    size : float
        The mean age of repeated readings, s; the length of a moving mean, rows; NaN of others.
    """

    name: str
    recording: int
    rows: int
    start: float
    stop: float
    size: float

    def in_words(self) -> str:
        """What the sensor did, and where."""
        words = SENSOR_WORDS[self.name]
        return words.format(rows=self.rows, size=self.size, start=self.start, stop=self.stop)


def causes_of(found: native.FamilyFit) -> tuple[Cause, ...]:
    """The causes in the answer of the kernel."""
    named = []
    for kind, size, error, time, _, lead, rivals in found.causes:
        reach = REACH * error if math.isfinite(error) else math.inf
        ends = (size - reach, size + reach)
        began = None if math.isnan(time) else time
        others = dict.fromkeys(NAMES.get(rival, rival) for rival in rivals)
        others.pop(name := NAMES.get(kind, kind), None)
        named.append(Cause(name, size, ends, began, lead, tuple(others), kind))
    return tuple(named)


def sensor_faults_of(found: native.FamilyFit) -> tuple[SensorFault, ...]:
    """What sensors did, in the answer of the kernel."""
    return tuple(SensorFault(*fault) for fault in found.sensor_faults)
