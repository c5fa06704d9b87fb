"""Simulation of a loop in fixed steps, as block-diagram tools do it, to compare their results."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.validation import finite, positive
from deadtime.loops._control_loop import ControlLoop
from deadtime.loops._inputs import Input, SampledNoise, held_input
from deadtime.loops._runs import LoopRun, reference_jumps
from deadtime.loops._specification import LoopSpecification, refuse_discretised
from deadtime.systems import Response

#: A time counts as a whole number of steps if it differs by less than this, in steps: rounding of
#: decimal step sizes must pass, a wrong step size must not.
_WHOLE = 1e-9


@dataclass(frozen=True, slots=True)
class FixedStepSettings:
    """Delay, limit and sampling of the loop, and settings of the run."""

    delay: float
    delay_path: str
    bounds: tuple[float, float] | None
    sample_steps: int | None
    solver: str
    step: float
    steps: int
    initial_output: float
    #: Load, disturbance of the output and noise: times and values.
    inputs: list[tuple[Array, Array]]


def simulate_fixed_step(
    loop: ControlLoop,
    end: float,
    reference: ArrayLike = 1.0,
    *,
    step: float,
    solver: str = "ode3",
    load: Input | None = None,
    output_disturbance: Input | None = None,
    noise: Input | SampledNoise | None = None,
    seed: int | np.random.SeedSequence = 0,
    initial_output: float = 0.0,
    reference_before: float | None = None,
    reference_time: ArrayLike | None = None,
) -> Response:
    """Simulate a loop in fixed steps, with the errors of a block diagram run in this way.

    For comparison with results of Simulink and similar tools; `ControlLoop.simulate` is exact. The
    delay is a transport delay as in these tools: a buffer of the values at whole steps with linear
    interpolation, and linear extrapolation beyond its newest value if the delay is shorter than a
    stage of the formula. Every stage reads the reference at its own time, steps do not end at jumps
    of the reference, and an ideal derivative is the difference quotient since the latest whole
    step. The buffer alone limits the order to two, jumps between steps to one.

    Parameters
    ----------
    loop : ControlLoop
        A loop with a known delay. Its `delay_path` decides whether the buffer holds the command or
        the measurement; its sample time, if any, is a whole number of steps.
    end : float
        Time of the last step in s; rounded up to a whole number of steps.
    reference : float or array_like, shape (m,)
        A number: a step to it at time 0. An array: values that hold from the times in
        `reference_time` on.
    step : float
        Length of a step in s.
    solver : {"ode1", "ode2", "ode3", "ode4", "ode5", "ode8"}
        Euler, Heun, Bogacki and Shampine, Kutta, Dormand and Prince of order 5 and 8.
    load, output_disturbance, noise, seed
        As of `ControlLoop.simulate`, but no functions; arrays have values for times 0, step, 2
        step, .... Every stage reads them at its own time.
    initial_output : float
        Output of the plant, which is at rest at the start.
    reference_before : float, optional
        Reference before its first jump; `initial_output` by default.
    reference_time : array_like, shape (m,), optional
        Times in s of the values of an array `reference`, increasing.

    Returns
    -------
    Response
        At times 0, step, 2 step, ..., with linear interpolation between them.

    Raises
    ------
    ValueError
        If the delay is None, an argument is out of its range, the sample time is not a whole number
        of steps, there is an algebraic loop, or the response grows beyond 1e150.

    Notes
    -----
    The eighth-order formula is that of Prince and Dormand (1981), the fifth that of Dormand and
    Prince (1980), the third that of Bogacki and Shampine (1989).

    Examples
    --------
    The overshoot of a loop with a limit, in coarse steps and exactly:

    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(
    ...     dtm.Integrator(), dtm.P(Kp=1.31), delay=0.3682, limit=1.0, delay_path="measurement"
    ... )
    >>> coarse = dtm.simulate_fixed_step(loop, 10.0, step=0.065, solver="ode8")
    >>> print(f"{coarse.info()['overshoot']:.3f} {loop.step_response().info()['overshoot']:.3f}")
    2.300 2.275
    """
    duration, length = finite("end", end), positive("step", step)
    if duration < 0.0:
        raise ValueError(
            f"end={duration} s is before the start of the run, which is at 0: give a later end"
        )
    refuse_discretised(loop.controller, loop.sample_time, "a run in fixed steps")
    if loop.rate_limit is not None or getattr(loop.controller, "anti_windup", None) is not None:
        raise ValueError(
            "a run in fixed steps cannot have a rate_limit or anti_windup: leave them out, or "
            "use loop.simulate"
        )
    specification = loop.specification
    delay = specification.known_delay
    initial = finite("initial_output", initial_output)
    before = initial if reference_before is None else finite("reference_before", reference_before)
    if reference_time is None and np.ndim(reference):
        raise ValueError(
            f"reference has shape {np.shape(reference)}: give reference_time too, with the time "
            "from which each value is valid"
        )
    jumps = reference_jumps(np.zeros(1), reference, reference_time, before)
    past = jumps.just_before(0.0)
    run = LoopRun(*specification.rest_at(initial, past), before, jumps.values, jumps.times)
    settings = FixedStepSettings(
        delay=delay,
        delay_path=loop.delay_path,
        bounds=None if loop.limit is None else specification.bounds,
        sample_steps=_sample_steps(loop.sample_time, length),
        solver=solver,
        step=length,
        steps=_steps(duration, length),
        initial_output=initial,
        inputs=_inputs(
            specification,
            (length, _steps(duration, length)),
            {"load": load, "output": output_disturbance, "noise": noise},
            seed,
        ),
    )
    found = specification.kernel.fixed_step(run, settings)
    times = length * np.arange(settings.steps + 1, dtype=np.float64)
    # As such a tool plots them.
    lines: Any = partial(np.interp, xp=times, fp=found.outputs)
    moved = np.diff(jumps.values, prepend=before) != 0.0
    within = (jumps.times >= 0.0) & (jumps.times <= times[-1])
    return Response(
        time=times,
        outputs=found.outputs,
        inputs=found.inputs,
        breaks=jumps.times[moved & within],
        reference=jumps.at(times),
        steady_state=specification.steady_state(float(jumps.values[-1])),
        _dense=lines,
    )


def _inputs(
    loop: LoopSpecification, steps: tuple[float, int], given: dict[str, Any], seed: Any
) -> list[tuple[Array, Array]]:
    found = []
    for name, put in given.items():
        if put is None:
            found.append((np.empty(0), np.empty(0)))
        elif callable(put) and not isinstance(put, SampledNoise):
            raise ValueError(
                f"{name} is a function, and fixed steps would miss the points where the "
                "function bends. Give a number, an array or a pair (times, values)"
            )
        else:
            times = steps[0] * np.arange(steps[1] + 1.0)
            found.append(held_input(loop, name, put, times, seed))
    return found


def _steps(duration: float, step: float) -> int:
    """Return the number of steps that reach `duration`."""
    count = duration / step
    if count > 2**53:
        raise ValueError(
            f"with step={step} s the run has {count:.1e} steps, which is too many: give a "
            "longer step"
        )
    return round(count) if abs(count - round(count)) <= _WHOLE else math.ceil(count)


def _sample_steps(sample_time: float | None, step: float) -> int | None:
    if sample_time is None:
        return None
    ratio = sample_time / step
    if ratio < 0.5 or abs(ratio - round(ratio)) > _WHOLE * ratio:
        raise ValueError(
            f"the sample time of {sample_time} s is {ratio:.6g} steps, which is not a whole "
            "number: give a step that divides the sample time"
        )
    return round(ratio)
