"""The gate that gains pass before they leave the package, with a reason for every refusal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.validation import non_negative, positive
from deadtime.estimation import DelayEstimate, PlantEstimate
from deadtime.loops import Controller, ControlLoop
from deadtime.tuning._demands import half_range, limit_in_words, white_to
from deadtime.tuning._found_plants import possible_loops, refusal
from deadtime.tuning._native import noise_gain
from deadtime.tuning._region import NUMBERS, region_of

#: Largest factor by which a gain changes in one step against the one that was flown: larger changes
#: leave what the estimate has seen.
LARGEST_CHANGE = 2.0

#: Largest Ms that passes where none is demanded: beyond it the loop oscillates (Astrom and Hagglund
#: 2006, section 4.5).
LARGEST_SENSITIVITY = 2.0

#: Largest standard deviation of the noise on the command, as a share of the limit.
LARGEST_NOISE = 0.1

#: What gains are called.
GAINS = ("Kp", "Ki", "Kd", "Kv")

#: A mode that does not show in the loop gain is hidden where pole and zero agree to this part; one
#: is slow where it is nearer to the axis than this part of the crossover.
_SAME = 1e-6
_SLOW = 0.2


@dataclass(frozen=True, eq=False, repr=False)
class Gate(ReadOnlyArrays):
    """Whether gains may leave the package; made by `check_gains` and `Design.gate`.

    Attributes
    ----------
    passed : bool
        Whether there is no reason against them.
    reasons : tuple of str
        Why not, a sentence each.
    overridden : tuple of str
        Reasons that `override` has set aside.
    checked : tuple of str
        What was checked.
    gains : dict of str to float
    max_sensitivity : float
        The largest Ms over all loops; NaN where one is not stable.
    noise : float or None
        Standard deviation of the noise on the command, where that of the measurement is known.
    """

    passed: bool
    reasons: tuple[str, ...]
    overridden: tuple[str, ...]
    checked: tuple[str, ...]
    gains: dict[str, float]
    max_sensitivity: float
    noise: float | None

    def __repr__(self) -> str:
        state = "passed" if self.passed else f"refused: {'; '.join(self.reasons)}"
        return f"<Gate {state}>"

    def __bool__(self) -> bool:
        return self.passed

    def summary(self) -> str:
        """The verdict, and every reason on a line of its own.

        Returns
        -------
        str
        """
        gains = ", ".join(f"{name} = {value:.4g}" for name, value in self.gains.items())
        lines = [f"{gains}: {'passed' if self.passed else 'refused'}", *self.reasons]
        lines += [f"set aside: {reason}" for reason in self.overridden]
        return "\n".join(lines)


def check_gains(
    of: ControlLoop | DelayEstimate | PlantEstimate,
    gains: Controller | Mapping[str, float],
    *,
    flown: Controller | Mapping[str, float] | None = None,
    loops: Sequence[ControlLoop] = (),
    max_sensitivity: float = LARGEST_SENSITIVITY,
    noise: float | None = None,
    noise_share: float = LARGEST_NOISE,
    bandwidth: float | None = None,
    amplitude: float | None = None,
    level: float = 0.95,
    largest_change: float = LARGEST_CHANGE,
    override: bool = False,
) -> Gate:
    """Check gains before they are set in a machine.

    They pass if the estimate is reliable, the sign of the plant's gain is certain, the loop is
    stable with Ms of at most `max_sensitivity` over all of the region, nothing unstable or slow is
    hidden from the loop, a step of `amplitude` comes to rest within the limit, the noise on the
    command is a small share of the limit, and no gain changes by more than a factor of two in one
    step.

    Parameters
    ----------
    of : DelayEstimate, PlantEstimate or ControlLoop
        An estimate, whose region of the level `level` is checked, or a loop that is known.
    gains : Controller or mapping of str to float
        What is to be set. A mapping changes gains of the loop's controller.
    flown : Controller or mapping of str to float, optional
        The gains that the machine has now: those of the loop of an estimate if not given. A gain
        that it does not have yet is not compared.
    loops : sequence of ControlLoop, optional
        Further plants that the gains must hold for.
    max_sensitivity : float
        Largest Ms.
    noise : float, optional
        Standard deviation of the measurement noise; that of the estimate where it has one.
    noise_share : float
        Largest standard deviation of the command, as a share of the limit.
    bandwidth : float, optional
        Up to where the noise is white, rad/s, as in `design`.
    amplitude : float, optional
        Height of the step with which the limit is tried; half of what the limit lets rest if not
        given. Nothing is tried without a limit.
    level : float
        Probability of the region of an estimate.
    largest_change : float
        Largest factor by which a gain may change.
    override : bool
        Set aside that an estimate is an indication. The result says so; nothing else is set aside.

    Returns
    -------
    Gate

    Raises
    ------
    ValueError
        If the delay of a loop is not known, a number is out of its range, or a mapping names what
        is no gain.
    TypeError
        If `of` is neither an estimate nor a loop.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.2), delay=0.36)
    >>> dtm.check_gains(loop, {"Kp": 1.4}).passed
    True
    >>> dtm.check_gains(loop, {"Kp": 3.0})
    <Gate refused: Ms is 3.663 in the worst loop, but at most 2 is allowed; the gain Kp ...
    """
    judge = _Judge(positive("max_sensitivity", max_sensitivity))
    every = [*judge.loops_of(of, gains, level, override), *(_with(case, gains) for case in loops)]
    loop = every[0]
    judge.stability(every)
    judge.hidden_modes(loop)
    judge.limit(every, amplitude)
    size = noise if noise is not None else _noise_of(of)
    if size is not None:
        size = non_negative("noise", size)
    if bandwidth is not None:
        positive("bandwidth", bandwidth)
    judge.noise(every, size, positive("noise_share", noise_share), bandwidth)
    if flown is None and not isinstance(of, PlantEstimate):
        flown = (of.loop if isinstance(of, DelayEstimate) else of).controller
    if flown is not None:
        judge.change(loop, flown, positive("largest_change", largest_change))
    return judge.gate(loop)


def gate_of_loops(
    every: Sequence[ControlLoop],
    doubt: str | None,
    flown: Controller | Mapping[str, float] | None,
    noise: float | None,
    override: bool,
) -> Gate:
    """The gate of gains in all loops that a design was made for, the middle one first."""
    judge = _Judge(LARGEST_SENSITIVITY)
    judge.doubt(doubt, override)
    judge.stability(every)
    judge.hidden_modes(every[0])
    judge.limit(every, None)
    judge.noise(every, noise, LARGEST_NOISE, None)
    if flown is not None:
        judge.change(every[0], flown, LARGEST_CHANGE)
    return judge.gate(every[0])


class _Judge:
    """What is found, check by check."""

    def __init__(self, most: float) -> None:
        self.most = most
        self.reasons: list[str] = []
        self.overridden: list[str] = []
        self.checked: list[str] = []
        self.sensitivity = math.nan
        self.on_command: float | None = None

    def gate(self, loop: ControlLoop) -> Gate:
        return Gate(
            passed=not self.reasons,
            reasons=tuple(self.reasons),
            overridden=tuple(self.overridden),
            checked=tuple(self.checked),
            gains=loop.controller.gains,
            max_sensitivity=self.sensitivity,
            noise=self.on_command,
        )

    def doubt(self, why: str | None, override: bool) -> None:
        """Note why an estimate cannot be relied on, if it cannot."""
        self.checked.append("estimate")
        if why is not None:
            reason = f"the estimate is not reliable: {why}"
            (self.overridden if override else self.reasons).append(reason)

    def loops_of(
        self,
        of: ControlLoop | DelayEstimate | PlantEstimate,
        gains: Controller | Mapping[str, float],
        level: float,
        override: bool,
    ) -> list[ControlLoop]:
        """The loop with the gains, and those all around the region of an estimate."""
        if isinstance(of, ControlLoop):
            _ = of.specification.known_delay
            return [_with(of, gains)]
        if isinstance(of, PlantEstimate):
            if not isinstance(gains, Controller):
                raise TypeError(
                    f"gains={gains!r}: a PlantEstimate has no controller, so give a controller here"
                )
            self.doubt(refusal(of), override)
            return self._signed(of, possible_loops(of, gains, level), level)
        if not isinstance(of, DelayEstimate):
            raise TypeError(f"of={of!r}: give a DelayEstimate, a PlantEstimate or a ControlLoop")
        self.doubt(None if of.verdict == "reliable" else of.reason or of.verdict, override)
        loop = _with(of.loop, gains)
        if not of.calibrated:
            self.reasons.append(f"the estimate has no confidence region: {of.uncalibrated}")
            return [loop]
        if not any(name in NUMBERS for name in of.free):
            return [loop]
        around = []
        try:
            points = region_of(of, level, allow_indication=True).points
            around = [loop.replace(**point) for point in points]
        except ValueError as error:
            self.reasons.append(str(error))
        return self._signed(of, [loop, *around], level)

    def _signed(
        self, of: DelayEstimate | PlantEstimate, loops: list[ControlLoop], level: float
    ) -> list[ControlLoop]:
        """These loops, or the first one where the sign of their gain is not certain."""
        free = of.free if isinstance(of, DelayEstimate) else of.intervals
        if "gain" not in free:
            return loops
        self.checked.append("sign of the gain")
        low, high = of.ci(level, "gain")
        if low * high > 0.0:
            return loops
        self.reasons.append(
            f"the sign of the plant's gain is not certain, because its interval is {low:.3g} to "
            f"{high:.3g}"
        )
        return loops[:1]

    def stability(self, every: Sequence[ControlLoop]) -> None:
        """Each loop stable, with a moderate Ms."""
        self.checked += ["stability", "Ms"]
        worst = 0.0
        for loop in every:
            try:
                found = loop._margin(delay_margin=False)
            except ValueError as error:
                self.reasons.append(f"the margins are not known if {_numbers(loop)}: {error}")
                return
            if not found.stable:
                self.reasons.append(f"the loop is not stable if {_numbers(loop)}")
                return
            worst = max(worst, found.max_sensitivity)
        self.sensitivity = worst
        if worst > self.most * (1.0 + 1e-6):
            self.reasons.append(
                f"Ms is {worst:.4g} in the worst loop, but at most {self.most:g} is allowed"
            )

    def hidden_modes(self, loop: ControlLoop) -> None:
        """No pole that a zero hides and that grows, or decays slowly."""
        if not loop.plant.is_rational:
            return
        self.checked.append("hidden modes")
        num, den = loop.plant.polynomials()
        above, below = (
            loop.controller.transfer_function().num,
            loop.controller.transfer_function().den,
        )
        zeros = np.concatenate([np.roots(num), np.roots(above.coefficients[0][::-1])])
        poles = np.concatenate([np.roots(den), np.roots(below.coefficients[0][::-1])])
        if not len(zeros) or not len(poles):
            return
        scale = max(1e-300, float(np.abs(poles).max()), float(np.abs(zeros).max()))
        crossing = loop._margin(delay_margin=False).gain_crossovers
        slow = _SLOW * float(crossing.min()) if len(crossing) else 0.0
        for pole in poles:
            off = float(np.abs(zeros - pole).min())
            if off <= _SAME * max(abs(pole), 1e-9 * scale) and pole.real > -slow:
                kind = "unstable" if pole.real >= 0.0 else "slow"
                self.reasons.append(
                    f"a zero cancels the {kind} pole at {pole:.4g} 1/s in the loop, but a load "
                    "still excites this pole"
                )
                return

    def limit(self, every: Sequence[ControlLoop], amplitude: float | None) -> None:
        """A step comes to rest within the limit in each loop."""
        bounded = [loop for loop in every if loop.limit is not None and loop.plant.is_rational]
        if not bounded or self.reasons:
            return
        self.checked.append("limit")
        for loop in bounded:
            command = loop.specification.command_at_rest(1.0)
            # An integrator rests at any output: the step that the gain drives to the limit.
            need = command or max(loop.controller.gains.values(), key=abs)
            height = _largest_step(loop, need) if amplitude is None else amplitude
            try:
                settled = loop.step_response(amplitude=height).info()["settling_time"]
            except ValueError:
                settled = math.nan
            if not math.isfinite(settled):
                self.reasons.append(
                    f"a step of {height:.3g} does not come to rest within the limit of "
                    f"{limit_in_words(loop)} if {_numbers(loop)}"
                )
                return

    def noise(
        self,
        every: Sequence[ControlLoop],
        size: float | None,
        share: float,
        bandwidth: float | None,
    ) -> None:
        """The noise on the command is a small share of the limit."""
        if size is None or self.reasons:
            return
        gains = [noise_gain(loop.specification.kernel, white_to(loop, bandwidth)) for loop in every]
        self.on_command = max(gains) * size
        limit = half_range(every[0])
        if math.isinf(limit):
            return
        self.checked.append("noise")
        if self.on_command > share * limit:
            self.reasons.append(
                f"the noise on the command has a standard deviation of {self.on_command:.3g}, "
                f"{100 * self.on_command / limit:.3g} % of the limit: allow more noise, or "
                "filter the derivative"
            )

    def change(
        self, loop: ControlLoop, flown: Controller | Mapping[str, float], most: float
    ) -> None:
        """No gain changes by more than a factor, or its sign."""
        self.checked.append("change")
        before = flown.gains if isinstance(flown, Controller) else dict(flown)
        for name in before:
            if name not in GAINS:
                raise ValueError(
                    f"flown contains {name!r}, which is not a gain: give gains from "
                    f"{', '.join(GAINS)}"
                )
        after = _by_term(loop.controller.gains)
        for name, was in _by_term(before).items():
            now = after.get(name, 0.0)
            if was == now:
                continue
            values = f"from {was:.4g} to {now:.4g}"
            if was * now < 0.0:
                self.reasons.append(f"the gain {name} changes its sign, {values}")
            elif was != 0.0 and not 1.0 / most <= now / was <= most * (1.0 + 1e-12):
                self.reasons.append(
                    f"the gain {name} changes {values}, which is more than a factor of {most:g}"
                )


def _by_term(gains: Mapping[str, float]) -> dict[str, float]:
    """Gains by their term: that of a derivative has two names."""
    return {"Kd" if name == "Kv" else name: value for name, value in gains.items()}


def _with(loop: ControlLoop, gains: Controller | Mapping[str, float]) -> ControlLoop:
    if isinstance(gains, Controller):
        return loop.replace(controller=gains)
    own = loop.controller.gains
    for name, value in gains.items():
        if name not in own:
            raise ValueError(
                f"{name}={value!r} is not a gain of this controller. Its gains are {', '.join(own)}"
            )
    return loop.replace(**gains)


def _largest_step(loop: ControlLoop, need: float) -> float:
    """Half of the largest step with a rest within the limit; a step of 1 needs `need`."""
    low, high = loop.specification.bounds
    if need == 0.0:
        return 1.0
    down, up = sorted((low / need, high / need))
    most = up if up >= -down else down
    return 0.5 * most if math.isfinite(most) else 1.0


def _noise_of(of: ControlLoop | DelayEstimate | PlantEstimate) -> float | None:
    """The standard deviation of the measurement noise by an estimate, where it has one."""
    if isinstance(of, PlantEstimate):
        return of.noise_std if math.isfinite(of.noise_std) else None
    if isinstance(of, DelayEstimate) and of.noise is not None:
        return of.noise.white
    return None


def _numbers(loop: ControlLoop) -> str:
    """The numbers of the plant in words."""
    numbers = loop.plant.parameters | {"delay": loop.delay}
    return ", ".join(f"{name} = {value:.4g}" for name, value in numbers.items())
