"""What a control loop does in time: simulations, step and impulse responses.

With the delay in the measurement the true output runs ahead of what the stepper calls y by the
delay, so outputs are asked for that much later and their breaks are moved back.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.validation import finite, one_dimensional
from deadtime.loops._inputs import Input, SampledNoise, at_samples, driven
from deadtime.loops._load_response import (
    LoadResponse,
    asked,
    figures_of,
    load_response_of,
    shown_times,
)
from deadtime.loops._native import LoopResponse, driven_loop, on_samples
from deadtime.loops._poles import is_unstable
from deadtime.loops._run_with_delays import settled_step_with_delays, simulate_with_delays
from deadtime.loops._runs import LoopRun, RunArguments, reference_jumps
from deadtime.loops._sensitivities import output_and_input_slopes, slope_names
from deadtime.loops._specification import LoopSpecification
from deadtime.systems import Response, response_of, until_settled

#: No commands before the start.
_NONE: tuple[float, ...] = ()


class LoopInTime:
    """The simulations of a `ControlLoop`."""

    specification: LoopSpecification

    def simulate(
        self,
        time: ArrayLike,
        reference: ArrayLike | Callable[[Any], Any] = 1.0,
        *,
        load: Input | None = None,
        output_disturbance: Input | None = None,
        noise: Input | SampledNoise | None = None,
        seed: int | np.random.SeedSequence = 0,
        initial_output: float = 0.0,
        reference_before: float | None = None,
        reference_time: ArrayLike | None = None,
        command_history: ArrayLike = _NONE,
        sample_phase: float = 0.0,
        sensitivities: Sequence[str] = (),
    ) -> Response:
        """Response to a reference, loads and noise, exact to rounding.

        The run starts at ``time[0]`` with the plant at rest at `initial_output`, under the command
        that keeps it there.

        Parameters
        ----------
        time : array_like, shape (n,)
            Output times in s, increasing.
        reference : float, array_like of shape (m,), or callable
            A number: a step to it at the start. An array: values that hold from the times in
            `reference_time` on. A function of an array of times in s; a sampled loop reads it at
            its samples.
        load : float, array_like of shape (n,), (times, values), or callable, optional
            Added to the command where it reaches the plant, after its limit. A number: a step to it
            at the start. An array: values that hold from each element of `time` on. A pair: values
            that hold from these times on, zero before. A function of an array of times in s; a
            pulse that is shorter than 1/1000 of the run and between two output times may be missed.
        output_disturbance : as `load`, optional
            Added to the output of the plant.
        noise : float, array_like, (times, values), callable, or noise model, optional
            Added to the output that the controller sees. A number: the standard deviation of
            independent normal values, drawn at the samples of the loop, in continuous time at the
            elements of `time`, each held until the next. A noise model, such as
            `deadtime.experiments.FlightNoise`, is drawn at the same times. All else as `load`.
        seed : int or numpy.random.SeedSequence
            Of the noise that is drawn.
        initial_output : float
            Output at the start.
        reference_before : float, optional
            Reference before the first jump; `initial_output` by default.
        reference_time : array_like, shape (m,), optional
            Times of the values of an array `reference`, increasing, in the same clock as `time`;
            `time` itself where the lengths agree.
        command_history : array_like, optional
            Sampled loops: the commands issued at the samples before the start, the latest last.
            Those still under way arrive as they did; before them the plant was at rest.
        sample_phase : float
            Sampled loops: time in s from the start to the first sample, in [0, sample_time).
        sensitivities : sequence of str, optional
            Names of `parameters` with respect to which the response is differentiated: see
            `Response.sensitivities`.

        Returns
        -------
        Response

        Raises
        ------
        ValueError
            If the delay is None, an argument is out of its range, or the response grows beyond
            1e150; the message says when.

        Notes
        -----
        Continuous loops are integrated by the method of steps in Taylor elements that end at
        every breaking point, sampled ones by matrix exponentials between events; see the
        description of the delay differential equations in the manual. A sampled controller reads
        output and reference at the sample; one that lies on a jump reads the reference after it.

        Sensitivities are exact as well: the same engines run in numbers that carry a slope, and
        jumps, samples and switching times move with the parameter. At a time at which the
        response jumps, the derivative is that of what follows the jump; where the delay is a
        whole number of samples, that for a longer delay.

        A function is taken as polynomials of degree 7, each as good as rounding; where it jumps,
        the jump is located to 1e-11 of the run.

        A loop whose plant has delays inside is simulated by its transfer functions; it starts at
        rest under `reference_before`, and has no sensitivities.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1.31), delay=0.36, limit=1.0)
        >>> response = loop.simulate([0.0, 1.0, 2.0, 10.0], reference=2.0)
        >>> print(response.outputs)
        [0.         0.64       1.63876861 2.        ]

        How the output answers to the delay and to the gain:

        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1.31), delay=0.36)
        >>> response = loop.simulate([0.0, 0.5, 1.0], sensitivities=("delay", "Kp"))
        >>> print(response.sensitivities["delay"])       # before 2 delays: y = Kp (t - delay)
        [ 0.         -1.31       -0.348984]

        A load leaves an offset under P control, load/Kp:

        >>> response = loop.simulate([0.0, 1.0, 40.0], 0.0, load=0.5)
        >>> print(response.outputs.round(6))
        [0.       0.368995 0.381679]
        """
        loop = self.specification
        respond = loop.respond
        run: LoopRun | float
        if (
            respond is not None
            and isinstance(reference, float)
            and type(initial_output) is type(sample_phase) is float
            and initial_output == sample_phase == 0.0
            and reference_before is reference_time is None
            and command_history is _NONE
            and load is output_disturbance is noise is None
        ):
            times, run, past = one_dimensional("time", time), reference, 0.0
        else:
            given = RunArguments(
                time, reference, initial_output, reference_before, reference_time,
                command_history, sample_phase, sensitivities,
                {"load": load, "output": output_disturbance, "noise": noise}, seed,
            )  # fmt: skip
            if respond is None:
                return simulate_with_delays(loop, given)
            times = one_dimensional("time", time)
            if callable(reference) or any(x is not None for x in (load, output_disturbance, noise)):
                return _driven_response(loop, times, given)
            run, past = _run_of(loop, times, given)
        response = response_of(_Again(loop, run, respond(times, run)))
        if not sensitivities:
            return response
        names, start = slope_names(loop, sensitivities), float(times[0])
        whole = _whole(loop, run)
        slopes, input_slopes = output_and_input_slopes(
            loop,
            names,
            (float(initial_output), past),
            _moved(loop, response.time - start, start, whole.sample_phase),
            _since_start(loop, start, whole),
        )
        return replace(response, sensitivities=slopes, input_sensitivities=input_slopes)

    def step_response(self, time: ArrayLike | None = None, amplitude: float = 1.0) -> Response:
        """Response to a step of the reference from rest at zero.

        Parameters
        ----------
        time : array_like, optional
            Output times in s; by default 501 from the step until the response has settled, or
            has visibly failed to.
        amplitude : float
            Height of the step.

        Returns
        -------
        Response

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=2.0), delay=0.36)
        >>> round(loop.step_response().info()["overshoot"], 3)
        22.475
        """
        if time is not None:
            return self.simulate(time, amplitude)
        loop, amplitude = self.specification, finite("amplitude", amplitude)
        if not loop.plant.is_rational:
            return settled_step_with_delays(loop, amplitude)
        longest = loop.known_delay + (loop.sample_time or 0.0)
        return until_settled(lambda times: self.simulate(times, amplitude), loop.model.A, longest)

    def load_response(
        self,
        time: ArrayLike | None = None,
        size: float = 1.0,
        *,
        at: Literal["input", "output"] = "input",
        settling: float = 0.02,
    ) -> LoadResponse:
        """Response to a step of a load from rest at zero, with its figures.

        Parameters
        ----------
        time : float or array_like, optional
            The end in s, or output times, increasing, of which the load steps at the first. By
            default the response is measured until it rests, and its integrals to infinity.
        size : float
            Height of the step, not zero.
        at : {"input", "output"}
            Where the load acts: added to the command where it reaches the plant, after its limit,
            or added to the output of the plant.
        settling : float
            The output has recovered within this part of its largest deviation.

        Returns
        -------
        LoadResponse

        Raises
        ------
        ValueError
            If the delay is None, an argument is out of its range, the plant has delays inside, the
            response grows beyond 1e150, or it does not come to rest and no end is given.

        Notes
        -----
        The integrals are sums of those of the polynomials of the response, between its zeros.
        Without an end the run goes on until the output is within 1e-7 of its largest deviation from
        its rest for a fifth of the run. Where no limit acts, the integral of the deviation is also
        known from the transfer function, for a load at the input and an integrating controller
        1/Ki, and the run must agree with it to 1e-7: no slow end is missed.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.PI(Kp=1.0, Ki=0.2), delay=0.3)
        >>> found = loop.load_response(size=0.5)
        >>> round(found.ie, 9), round(found.peak, 3)
        (2.5, 0.428)
        >>> loop.load_response(20.0, at="output").recovery_time > 3.0
        True
        """
        loop = self.specification
        question, times = asked(loop, time, size, at, settling)
        found = figures_of(loop, question)
        if times is None:
            if not found.is_settled:
                raise ValueError(
                    f"the output does not come to rest within {found.span:.4g} s after the "
                    "load. Either the loop is not stable, or the limit of the command is too "
                    "small for this load. To see the response until a certain time, give time="
                )
            times = shown_times(found)
        name = "load" if question.of == "load" else "output_disturbance"
        load: dict[str, Any] = {name: question.size}
        return load_response_of(self.simulate(times, 0.0, **load), found)

    def impulse_response(self, time: ArrayLike | None = None) -> Response:
        """Response to an impulse of the reference of unit area, from rest at zero.

        Parameters
        ----------
        time : array_like, optional
            As in `step_response`.

        Returns
        -------
        Response
            The derivative of the step response. Its inputs are NaN: the command holds an impulse
            where the controller passes the reference on.

        Raises
        ------
        ValueError
            If the loop is sampled or has a limit, its delay is None, or the output holds an
            impulse.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=2.0), delay=0.25)
        >>> print(loop.impulse_response([0.0, 0.25, 0.5, 0.75]).outputs)
        [0. 2. 2. 1.]
        """
        loop = self.specification
        loop.refuse_hold(
            "reads its reference only at samples, so it does not see an impulse: use "
            "continuous().impulse_response()"
        )
        for name in ("limit", "rate_limit"):
            if getattr(loop, name) is not None:
                raise ValueError(
                    f"{name}={getattr(loop, name)!r}: an impulse needs a command beyond any "
                    f"limit. Remove the limit with loop.replace({name}=None)"
                )
        found = loop.transfer("output").impulse_response(time)
        return replace(found, inputs=np.full_like(found.inputs, np.nan))


def _run_of(loop: LoopSpecification, times: Array, given: RunArguments) -> tuple[LoopRun, float]:
    """Check the arguments of `simulate`: the run, and the reference just before its start."""
    initial, before = given.rest()
    reference = given.reference
    held: float | Array
    past, held_from = before, None
    if type(reference) is float and given.reference_time is None:
        held = finite("reference", reference)
    else:
        jumps = reference_jumps(times, reference, given.reference_time, before)
        # The arrays belong to the caller; the response must not change with them.
        held, held_from = jumps.values.copy(), jumps.times.copy()
        if times.size and held_from[0] < times[0]:
            past = jumps.just_before(float(times[0]))
    history = None
    if not isinstance(given.command_history, tuple) or given.command_history:
        history = one_dimensional("command_history", given.command_history).copy()
    phase = finite("sample_phase", given.sample_phase)
    state, command = loop.rest_at(initial, past)
    return LoopRun(state, command, before, held, held_from, history, phase), past


def _driven_response(loop: LoopSpecification, times: Array, given: RunArguments) -> Response:
    """The response to inputs besides a held reference."""
    if given.sensitivities:
        raise ValueError(
            "sensitivities are not computed for a run with loads, noise or a function as "
            "input: leave sensitivities out"
        )
    if times.size == 0:
        raise ValueError("time is empty: give at least one output time")
    reference, inputs = given.reference, dict(given.inputs)
    phase = finite("sample_phase", given.sample_phase)
    if callable(reference):
        if given.reference_time is not None:
            raise ValueError(
                "reference is a function, which needs no reference_time: leave reference_time out"
            )
        if loop.sample_time is None:
            # From its value before the start on.
            before = given.rest()[1]
            inputs["reference"] = lambda when: np.asarray(reference(when)) - before
            given = given._replace(reference=before)
        else:
            when, values = at_samples(loop, reference, times, phase)
            given = given._replace(reference=values, reference_time=when)
    run, _ = _run_of(loop, times, given)
    put = driven(loop, times, phase, inputs, given.seed)
    run = run._replace(state=np.append(run.state, np.zeros(put.states)), kicks=put.kicks)
    found = driven_loop(loop.kernel, put.names).respond(times, run)
    again = _Again(loop, run, found, tuple(put.names))
    if not callable(reference) or loop.sample_time is not None:
        return response_of(again)
    shown = np.asarray(reference(times), dtype=float)
    return replace(response_of(again), reference=np.broadcast_to(shown, times.shape))


def _whole(loop: LoopSpecification, run: LoopRun | float) -> LoopRun:
    """A run; a number is the height of a step from rest at zero."""
    if isinstance(run, LoopRun):
        return run
    return LoopRun(*loop.rest_at(0.0, 0.0), reference=run)


def _since_start(loop: LoopSpecification, start: float, run: LoopRun) -> LoopRun:
    """The run in the clock of the stepper, which is zero at the start."""
    times = np.array([start]) if run.reference_time is None else run.reference_time
    since = _moved(loop, times - start, start, run.sample_phase)
    return run._replace(reference=np.atleast_1d(run.reference), reference_time=since)


def _moved(loop: LoopSpecification, since: Array, start: float, phase: float) -> Array:
    """Times since the start, moved onto the samples they miss by rounding only."""
    if loop.sample_time is None:
        return since
    return on_samples(since, start, loop.sample_time, phase)


class _Start(NamedTuple):
    """What is left of a response that was copied: its parts stand in the copy."""

    start: float


class _Again:
    """A run of a loop: its response, and outputs at other times, for which it is repeated."""

    __slots__ = ("found", "loop", "run", "states")

    def __init__(
        self,
        loop: LoopSpecification,
        run: LoopRun | float,
        found: LoopResponse | _Start,
        states: tuple[tuple[str, int], ...] = (),
    ) -> None:
        self.loop, self.run, self.found, self.states = loop, run, found, states

    def __reduce__(self) -> tuple[Any, ...]:
        return _Again, (self.loop, self.run, _Start(cast(float, self.found.start)), self.states)

    def steady_state(self) -> float | None:
        """Output at rest under the last reference, None without such a rest."""
        if self.states:
            output, command = self._rest()
            low, high = self.loop.bounds
            return output if command is not None and low <= command <= high else None
        return self.loop.steady_state(float(np.ravel(_whole(self.loop, self.run).reference)[-1]))

    def stays_settled(self, time: Array, inputs: Array, settled: float) -> bool:
        """Whether the response stays in the band in which it is since `settled`, s."""
        command = self._rest()[1]
        rest = np.nan if command is None else command
        return self.loop.kernel.stays_settled(time - time[0], inputs, rest, settled)

    def grows(self) -> bool:
        """Whether no limit acts in a loop that is proved to be unstable."""
        loop = self.loop
        is_free = loop.limit is None and loop.rate_limit is None and loop.plant.is_linear
        return is_free and is_unstable(loop)

    def _rest(self) -> tuple[float | None, float | None]:
        """Output and command at rest under the last reference and inputs, limits left out."""
        run = _whole(self.loop, self.run)
        last = float(np.ravel(run.reference)[-1])
        command = self.loop.command_at_rest(last)
        if command is None:
            return None, None
        output = self.loop.kernel.rest_gains()[0] * last
        for place, (name, degree) in enumerate(self.states):
            if degree or name == "noise" or run.kicks is None:
                return None, None
            _, inputs, values = run.kicks
            held = [value for put, value in zip(inputs, values, strict=True) if put == place]
            gains = [system.dcgain() for system in self.loop.transfers(name)]
            if held and not np.isfinite(gains).all():
                return None, None
            if held:
                output += gains[0] * held[-1]
                command += gains[1] * held[-1]
        return float(output), float(command)

    def __call__(self, times: Array) -> Array:
        start = cast(float, self.found.start)
        run = _since_start(self.loop, start, _whole(self.loop, self.run))
        native = self.loop.native
        if self.states:
            native = driven_loop(self.loop.kernel, [*self.states])
        return native.outputs(times - start + self.loop.output_lead, run)
