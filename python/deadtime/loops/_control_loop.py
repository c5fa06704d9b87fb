"""A feedback loop with a delay: plant, controller, delay, and the hold and limit around them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

from deadtime._base.drawing import Figure, new_figure
from deadtime._base.errors import DeadtimeError
from deadtime._base.explorer import Explorer
from deadtime._base.notebook import Pictured
from deadtime._base.validation import non_negative
from deadtime.loops._controllers import Controller
from deadtime.loops._explored import explorer_of
from deadtime.loops._gain import LoopGain
from deadtime.loops._given_controllers import controller_of
from deadtime.loops._given_plants import plant_and_delay
from deadtime.loops._in_time import LoopInTime
from deadtime.loops._plants import Plant
from deadtime.loops._poles import LoopPoles
from deadtime.loops._specification import UNEQUAL, LoopSpecification, is_unequal


@dataclass(frozen=True, init=False, repr=False)
class ControlLoop(LoopInTime, LoopPoles, LoopGain, Pictured):
    """A plant under feedback with one delay in the loop.

    The command u of the controller is limited, delayed by `delay` and reaches the plant as w.
    With `sample_time` the controller computes u only every `sample_time` seconds and holds it;
    such a loop is not a continuous one, and everything here treats it exactly.

    Parameters
    ----------
    plant : Plant, TransferFunction, DelaySystem or a system of python-control or scipy.signal
        `Integrator`, `FirstOrder`, `FactoredPlant` or `RationalPlant`; or a continuous system
        with one input and one output. A delay in series with it is added to `delay`, and is not
        part of the `plant` of the loop. With delays inside it becomes a
        `deadtime.loops.PlantWithDelays`, which takes no `sample_time` and no `limit`.
    controller : Controller, TransferFunction or a system as above
        `P`, `PV`, `PD`, `PI` or `PID`; or a transfer function that is one of them.
    delay : float, optional
        Delay in s, zero or more; None where it is not known yet.
    sample_time : float, optional
        Sample time in s; None for continuous time.
    limit : float or (float, float), optional
        Bound of the command, abs(u) <= limit, or the least and the greatest command, zero between
        them; None for no bound. `bounds` has both.
    rate_limit : float, optional
        Bound of the rate of the command after its limit, in its unit per s; in a sampled loop, of
        its change from sample to sample over `sample_time`. None for no bound.
    computation_time : float, optional
        Time in s from a sample to the command that is computed from it, added to `delay`.
    delay_path : {"command", "measurement"}
        Where the delay sits. Between command and plant, the output starts to move `delay` after a
        step; in the measurement, the output itself is the same function `delay` earlier. A plant
        with a delay in series has it between command and output, and takes "command" only.

    Raises
    ------
    ValueError
        If a number is negative, not finite or zero where it must not be; the message names it. If
        the plant is sampled, has several inputs or outputs, or is not proper and causal.
    TypeError
        If `plant` or `controller` is none.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=2.4), delay=0.36, sample_time=0.065)
    >>> loop.is_stable()
    True
    >>> info = loop.step_response().info()
    >>> round(info["overshoot"], 1), round(info["settling_time"], 2)
    (44.0, 4.31)

    A plant as a transfer function, its delay with it:

    >>> G = 0.9 / (dtm.s * (0.1 * dtm.s + 1)) * dtm.delay(0.36)
    >>> dtm.ControlLoop(G, dtm.P(Kp=1.5)).margin()
    <Margins: gain 2.697 at 3.442 rad/s, phase 54.78° at 1.338 rad/s, delay 0.7145 s at ...>
    """

    plant: Plant
    controller: Controller
    delay: float | None = None
    sample_time: float | None = None
    limit: float | None = None
    rate_limit: float | None = None
    delay_path: Literal["command", "measurement"] = "command"

    def __init__(
        self,
        plant: object,
        controller: object,
        *,
        delay: float | None = None,
        sample_time: float | None = None,
        limit: float | tuple[float, float] | None = None,
        rate_limit: float | None = None,
        computation_time: float = 0.0,
        delay_path: Literal["command", "measurement"] = "command",
    ) -> None:
        own, in_series = (plant, 0.0) if isinstance(plant, Plant) else plant_and_delay(plant)
        if in_series > 0.0:
            if delay_path == "measurement":
                raise ValueError(
                    "delay_path='measurement' is not possible, because the plant has a delay "
                    f"of {in_series:g} s between command and output: leave delay_path out, or "
                    "give the plant without its delay"
                )
            delay = in_series + (0.0 if delay is None else non_negative("delay", delay))
        controls = controller_of(controller)
        if computation_time:
            delay = _with_computation(computation_time, delay, delay_path)
        # Two bounds become what refuses to be one number.
        bound: Any = limit
        specification = LoopSpecification(
            own, controls, delay, sample_time, bound, rate_limit, delay_path
        )
        given = vars(specification)
        mine = {name: given[name] for name in _NAMES}
        mine["specification"] = specification
        object.__setattr__(self, "__dict__", mine)

    def __reduce__(self) -> tuple[Any, ...]:
        # Without what is kept for speed.
        return _loop_of, tuple(getattr(self, name) for name in _NAMES)

    def __repr__(self) -> str:
        shown = [
            f"{name}={getattr(self, name)!r}"
            for name in _NAMES
            if name != "rate_limit" or self.rate_limit is not None
        ]
        return f"ControlLoop({', '.join(shown)})"

    @property
    def is_sampled(self) -> bool:
        """Whether the command is held between samples."""
        return self.sample_time is not None

    @property
    def bounds(self) -> tuple[float, float]:
        """The least and the greatest command, infinite where there is no limit."""
        return self.specification.bounds

    @property
    def parameters(self) -> dict[str, float]:
        """The named numbers of the loop: those of plant and controller, then its own.

        Returns
        -------
        dict of str to float
            ``delay``, ``sample_time``, ``limit`` and ``rate_limit`` are there where they are not
            None, and unequal limits as ``limit_low`` and ``limit_high``.
        """
        return self.specification.parameters

    def replace(self, **changes: Any) -> ControlLoop:
        """Return the loop with other numbers or other parts.

        Parameters
        ----------
        **changes
            Names of `parameters`, or the arguments of `ControlLoop`.

        Returns
        -------
        ControlLoop

        Raises
        ------
        ValueError
            If the loop has no such name.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=2.4))
        >>> loop.replace(delay=0.36, Kp=3.0).parameters
        {'gain': 1.0, 'lag': 0.0, 'Kp': 3.0, 'delay': 0.36}
        """
        parts = {name: changes.pop(name, getattr(self, name)) for name in _NAMES}
        if is_unequal(parts["limit"]):
            pairs = zip(UNEQUAL, self.bounds, strict=True)
            parts["limit"] = tuple(changes.pop(name, own) for name, own in pairs)
        for part in ("plant", "controller"):
            if isinstance(parts[part], (Plant, Controller)):
                mine = parts[part].parameters
                numbers = {name: changes.pop(name) for name in mine if name in changes}
                if numbers:
                    parts[part] = parts[part]._replace(numbers)
        if changes:
            raise ValueError(
                f"{', '.join(changes)}: this loop has no such parameter. Its parameters are "
                f"{', '.join(self.parameters)}"
            )
        return ControlLoop(**parts)

    def continuous(self) -> ControlLoop:
        """Return the same loop without the hold, as if the controller computed all the time."""
        return self.replace(sample_time=None)

    def explore(self, ranges: Mapping[str, tuple[float, float]] | None = None) -> Explorer:
        """Return a page in which this loop is looked at live, its map over two gains in it.

        Delay, sample time, gains and the numbers of the plant move there; map, roots, margins and
        step responses follow, proved by the same kernels. The page needs no network.

        Parameters
        ----------
        ranges : mapping of str to (low, high), optional
            The two axes of the map at first: gains, ``"gain"``, ``"delay"`` or ``"lag"``. By
            default the first two gains, or the gain and the delay.

        Returns
        -------
        deadtime.loops.Explorer
            Its `show` opens it in the browser, its `save` writes it; in a notebook it shows itself.

        Raises
        ------
        ValueError
            If the delay is None, or the plant limits rates or has delays inside, or the filter of
            the derivative runs in samples.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(0.9), dtm.PV(Kp=1.5, Kv=0.1), delay=0.36)
        >>> page = loop.explore({"Kp": (0, 6), "Kv": (-0.9, 0.9)})
        >>> page.state["x_range"]
        [0.0, 6.0]
        """
        return explorer_of(self.specification, ranges)

    def _picture(self) -> Figure | None:
        """The step response, for a notebook; None for a loop that has none."""
        try:
            response = self.step_response()
        except (ValueError, DeadtimeError):
            return None
        figure, axes = new_figure()
        response.plot(axes, inputs=True)
        return figure


#: What a loop is made from.
_NAMES = tuple(field.name for field in fields(LoopSpecification))


def _loop_of(*values: Any) -> ControlLoop:
    return ControlLoop(**dict(zip(_NAMES, values, strict=True)))


def _with_computation(time: float, delay: float | None, path: str) -> float:
    """The delay with a computation time, which acts like it."""
    time = non_negative("computation_time", time)
    if delay is None:
        raise ValueError(
            f"computation_time={time:g} is added to the delay, but the delay is None: give "
            "both. Or, once their sum is known, give the sum as the delay"
        )
    if path == "measurement":
        raise ValueError(
            f"computation_time={time:g} delays the command, but delay_path='measurement' delays "
            "the measurement: leave one of the two out"
        )
    return non_negative("delay", delay) + time
