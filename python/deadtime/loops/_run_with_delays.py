"""Simulation of a loop whose plant has delays inside, by the transfer functions of the whole loop.

With the plant b/a, the feedback f/g and the reference path r/g of the controller, the reference
drives the output by b r e^(-s delay) / h and the command by a r / h, h = a g + b f e^(-s delay).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.validation import one_dimensional
from deadtime.loops._inputs import SampledNoise, held_input
from deadtime.loops._runs import RunArguments, reference_jumps
from deadtime.loops._specification import LoopSpecification
from deadtime.systems import Response, TransferFunction

#: Relative error to which an initial output must be the one at rest.
_AT_REST = 1e-9


def simulate_with_delays(loop: LoopSpecification, given: RunArguments) -> Response:
    """Check the arguments of `ControlLoop.simulate` and run the loop."""
    others = {
        "command_history": np.size(given.command_history) > 0,
        "sample_phase": given.sample_phase != 0.0,
        "sensitivities": len(given.sensitivities) > 0,
    }
    for name, is_given in others.items():
        if is_given:
            raise ValueError(
                f"{name}: a loop whose plant has delays inside cannot use this argument. The "
                "argument needs a plant that is rational except for one delay in series"
            )
    if callable(given.reference):
        raise ValueError(
            "reference is a function, but a loop whose plant has delays inside needs a number "
            "or an array: give values, and in reference_time the times at which they begin"
        )
    times = one_dimensional("time", given.time)
    if times.size == 0:
        raise ValueError("time is empty: give at least one output time")
    initial, before = given.rest()
    jumps = reference_jumps(times, given.reference, given.reference_time, before)
    start = float(times[0])
    past = jumps.just_before(start)
    output, command = _driven(loop)
    rest = output.dcgain() * past if past != 0.0 else 0.0
    if not abs(rest - initial) <= _AT_REST * max(abs(rest), abs(initial)):
        raise ValueError(
            f"initial_output={initial:g}: before the start the reference is {past:g}, and this "
            f"loop rests at {rest:g}. A loop with delays inside its plant can start only from "
            "this rest"
        )
    later = jumps.times >= start
    when = np.append(start, jumps.times[later])
    held = np.append(past, jumps.values[later])
    if when.size > 1 and when[1] == start:
        when, held = when[1:], held[1:]
    runs = [
        driven.simulate(times, held, input_time=when, input_before=past)
        for driven in (output, command)
    ]
    steady = output.dcgain() * float(jumps.values[-1])
    further = [
        _run_of(loop, name, given, times) for name in given.inputs if given.inputs[name] is not None
    ]
    if further:
        return _together([(runs[0], runs[1]), *further], times, jumps.at(times))
    return Response(
        time=times,
        outputs=runs[0].outputs,
        inputs=runs[1].outputs,
        breaks=np.union1d(runs[0].breaks, runs[1].breaks),
        reference=jumps.at(times),
        steady_state=steady if np.isfinite(steady) else None,
        _dense=runs[0]._dense,
    )


def _run_of(
    loop: LoopSpecification, name: str, given: RunArguments, times: Array
) -> tuple[Response, Response]:
    """Output and command under an input besides the reference, from rest."""
    driven = loop.transfers(name)
    put = given.inputs[name]
    if callable(put) and not isinstance(put, SampledNoise):
        runs = [system.simulate(times, put) for system in driven]
    else:
        when, values = held_input(loop, name, put, times, given.seed)
        runs = [system.simulate(times, values, input_time=when) for system in driven]
    return runs[0], runs[1]


def _together(
    runs: Sequence[tuple[Response, Response]], times: Array, reference: Array
) -> Response:
    """The sum of responses."""
    outputs, inputs = zip(*runs, strict=True)
    dense = [run._dense for run in outputs if run._dense is not None]
    return Response(
        time=times,
        outputs=np.sum([run.outputs for run in outputs], axis=0),
        inputs=np.sum([run.outputs for run in inputs], axis=0),
        breaks=np.unique(np.concatenate([run.breaks for run in (*outputs, *inputs)])),
        reference=reference,
        _dense=lambda when: np.sum([solution(when) for solution in dense], axis=0),
    )


def settled_step_with_delays(loop: LoopSpecification, amplitude: float) -> Response:
    """Step response up to where it has settled."""
    found = _driven(loop)[0].step_response(amplitude=amplitude)
    return simulate_with_delays(loop, RunArguments(found.time, amplitude))


def _driven(loop: LoopSpecification) -> tuple[TransferFunction, TransferFunction]:
    """From the reference to the output, and to the command."""
    command = loop.transfer("command")
    if not command.is_proper:
        raise ValueError(
            "a step of the reference would make the command of this loop an impulse. Give the "
            "controller a DerivativeFilter, or take the derivative of the measurement alone, "
            "as PV does"
        )
    return loop.transfer("output"), command
