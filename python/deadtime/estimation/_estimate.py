"""`estimate_delay`: choose and run an estimation method.

What a check finds binds: it is corrected and said, or the answer is an indication. Corrected are a
command that was logged one row late or early, where reference and P law show it; a sample time that
is not given; and a limit that is not given, for a fit of the loop. Anything else that may move the
delay by more than a share of its interval makes the answer an indication.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, overload

import deadtime.estimation.methods._method as base
from deadtime._base.digits import shown
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._result import REASONS, DelayEstimate
from deadtime.estimation.data._simulated import on_its_row, rows_off
from deadtime.estimation.evidence._estimate import PlantEstimate
from deadtime.estimation.evidence._find import estimate_by_evidence
from deadtime.estimation.evidence._question import Between
from deadtime.estimation.evidence._rival import beside_rivals
from deadtime.estimation.methods._frequency import Frequency
from deadtime.estimation.methods._input_output import GCC, ARXScan
from deadtime.estimation.methods._method import Loops, Method, Recordings, Run, Windows, paired_runs
from deadtime.estimation.methods._oscillation import Decrement, Relay
from deadtime.estimation.methods._output_error import OutputError
from deadtime.estimation.methods._step_response import Decay, Graphical, Overshoot
from deadtime.estimation.methods._waveform import CTA, Grid, Waveform
from deadtime.loops import Controller
from deadtime.recordings import Finding, Recording, RecordingCheck

#: The methods by name.
METHODS: Mapping[str, type[Method]] = {
    method.name: method
    for method in (
        OutputError,
        Waveform,
        Frequency,
        Grid,
        CTA,
        Overshoot,
        Decrement,
        Decay,
        Graphical,
        Relay,
        GCC,
        ARXScan,
    )
}

#: What is fitted in a loop if nothing is said.
FREE = ("delay", "gain")

#: Names of those that fit several recordings together.
JOINT = tuple(name for name, method in METHODS.items() if method.joint)


@overload
def estimate_delay(
    recording: Recordings,
    loop: Loops,
    *,
    method: str | Method = "auto",
    free: Sequence[str] = ("delay", "gain"),
    window: Windows = None,
) -> DelayEstimate: ...


@overload
def estimate_delay(
    recording: Recordings,
    loop: None = None,
    *,
    window: Windows = None,
    plant: str | None = None,
    controller: Controller | Sequence[Controller] | None = None,
    limit: float | None = None,
    closed_loop: bool | None = None,
    at_rest: bool | None = None,
    largest_delay: float | None = None,
    integrates: bool | None = None,
    between: Between = "undecided",
    hold: float | None = None,
    causes: bool | None = None,
    progress: Callable[[int], object] | None = None,
) -> PlantEstimate: ...


def estimate_delay(
    recording: Recordings,
    loop: Loops | None = None,
    *,
    method: str | Method = "auto",
    free: Sequence[str] = FREE,
    window: Any = None,
    plant: str | None = None,
    controller: Controller | Sequence[Controller] | None = None,
    limit: float | None = None,
    closed_loop: bool | None = None,
    at_rest: bool | None = None,
    largest_delay: float | None = None,
    integrates: bool | None = None,
    between: Between = "undecided",
    hold: float | None = None,
    causes: bool | None = None,
    progress: Callable[[int], object] | None = None,
) -> DelayEstimate | PlantEstimate:
    """Estimate the delay of a plant, or that of a closed loop, from a recording.

    Without `loop`, nothing is known but the recording: plants that integrate or come to rest, with
    no, one or two lags, real or complex, with or without a zero, compete on the same rows. With
    `loop`, its plant and controller are known, and `method` and `free` say what is fitted.

    Parameters
    ----------
    recording : Recording or list of Recording
        Reference, output and command over time, as logged where the controller runs. Without
        `loop` it has a command, and needs no reference. Several recordings of one plant are fitted
        together: without `loop`, or by ``"output_error"`` and ``"waveform"``.
    loop : ControlLoop or list of ControlLoop, optional
        What is known: plant, controller gains, sample time, limit; the delay is None or a guess.
        One for all recordings, or one each.
    method : str or Method
        What the delay is estimated from. An object of `deadtime.estimation` holds the options of a
        method, for example ``Waveform(noise="loop")``; a name is the short form of that object
        with its default options: ``"waveform"`` means ``Waveform()``.

        - ``"output_error"`` (`OutputError`): the response of the vehicle to the command as it was
          logged. Its standard error is the Cramér-Rao bound; ``"auto"`` takes it where all
          recordings have a command.
        - ``"waveform"`` (`Waveform`): the simulated response of the whole loop. ``"auto"`` takes it
          elsewhere.
        - ``"frequency"`` (`Frequency`): maximum likelihood at the lines of a spectrum, for periodic
          experiments.
        - ``"grid"`` (`Grid`): the cost over a range of delays, kept as a curve; ``"cta"`` (`CTA`):
          the waveform with Chebyshev's approximation of the delay.
        - ``"overshoot"`` (`Overshoot`): the overshoot of a step, as Armah & Yi did;
          ``"decrement"`` (`Decrement`): successive peaks; ``"decay"`` (`Decay`): the tail where
          nothing overshoots; ``"graphical"`` (`Graphical`): the beginning of a step.
        - ``"relay"`` (`Relay`): the period of a limit cycle.
        - ``"gcc"`` (`GCC`): generalised cross-correlation; ``"arx_scan"`` (`ARXScan`): what
          MATLAB's `delayest` does.
    free : sequence of str
        What is fitted, any of ``"delay"``, ``"gain"``, ``"lag"`` and ``"time_constant"``, as the
        plant has them, with `FactoredPlant` also ``"lag_1"`` and so on, ``"zero"``,
        ``"pole_frequency"`` and ``"pole_damping"``, with `RateLimited` also ``"rate"`` and
        ``"rate_of_rate"``, with `ParametricPlant` its numbers;
        ``"waveform"`` also fits ``"limit"`` and ``"start"``, how much later than that of the
        reference the clock of the output runs. ``"decrement"`` fits delay and gain;
        ``"overshoot"``, ``"decay"``, ``"graphical"``, ``"relay"``, ``"gcc"`` and ``"arx_scan"``
        the delay alone, and take what else they need as given.
    window : (low, high) or list of them, optional
        The part to use, s, None for an open end: one for all recordings, or a list with one each.
        For ``"waveform"``, ``"grid"``, ``"cta"`` and all methods that read a step, it should begin
        at rest and hold one step; ``"output_error"``, ``"frequency"``, ``"gcc"`` and
        ``"arx_scan"`` take any in which the command changes. Without `loop` any will do, and the
        commands before it are used.
    plant : str, optional
        Without `loop`: the kind of plant, if it is known: ``"delay"``, ``"lag"``, ``"two lags"``,
        ``"integrator"``, ``"integrator, lag"``, ``"integrator, two lags"``, or one that ends in
        ``"lag, zero"`` or ``"two lags, zero"``. Whether another explains the recording clearly
        better is said.
    controller : Controller or list of them, optional
        Without `loop`: the controller that computes the command from the output, if it is known;
        one for all recordings, or a list with one each. The command of a P controller need not be
        logged, and is moved where it was logged a row late or early.
    limit : float, optional
        Largest size of the command of `controller`.
    closed_loop : bool, optional
        Without `loop`: whether a controller computes the command from the output. If it is not
        given, a reference that moves says so.
    at_rest : bool, optional
        Without `loop`: whether the plant was at rest at the first row. If it is not given, the
        recording says so, or the state is unknown.
    largest_delay : float, optional
        Without `loop`: largest delay that is tried, s; by default 0.3 of the recording.
    integrates : bool, optional
        Without `loop`: whether the plant integrates, or comes to rest; by default the recording
        decides.
    between : {"undecided", "held", "straight", "samples"}
        Without `loop`: how the command moves between two rows. By default the recording
        decides; where it does not, intervals hold for a held and a straight command.
    hold : float, optional
        Without `loop`: for how long the controller holds each command, s, where it is logged less
        often than it is computed. Straight commands are half of that later.
    causes : bool, optional
        Without `loop`: whether what a linear plant lacks is looked for too, such as play of the
        actuator or a load, and readings that a sensor did not take. By default it is.
    progress : callable, optional
        Without `loop`: called with a number that grows while plants are compared.

    Returns
    -------
    DelayEstimate
        With `loop`.
    PlantEstimate
        Without.

    Raises
    ------
    NotIdentifiableError
        When the recording does not determine what was asked for: no step, no overshoot
        (Kp·Td below 1/e), an output that noise alone would explain, a setpoint that copies the
        output, a limit cycle where the method is of linear theory, parameters that cannot be
        distinguished.
    RecordingError
        When the window holds too few samples.
    TypeError
        For a method that is neither a name nor an object with options.
    ValueError
        For a method or free quantity that does not exist, or several recordings for a method that
        takes one.

    Notes
    -----
    A ground station sees the sum of all delays on the way round the loop; from its own log,
    it cannot distinguish the part in the command from the part in the measurement. A model that
    does not explain the recording is returned with ``verdict="indication"``, not refused, and so is
    one whose plant is clearly behind another that explains the recording. Several
    recordings are weighted by the inverse of their noise where residuals are white, and by that of
    their excitation where they are not.

    In a recording of more than 5000 rows, ``"output_error"`` searches on as many rows in which the
    command changes most (the longest delay is 0.6 of their time) and then finds the maximum of the
    likelihood on all rows. Its intervals are then from the curvature of the likelihood.

    References
    ----------
    S. Armah and S. Yi, "Analysis of Time Delays in Quadrotor Systems and Design of Control".

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> truth = dtm.ControlLoop(dtm.Integrator(0.8), dtm.P(2.4), delay=0.4, sample_time=0.065)
    >>> time = np.arange(150) * 0.065
    >>> step = np.where(time < 1.0, 0.0, 1.0)
    >>> response = truth.simulate(time, step, reference_time=time)
    >>> recording = dtm.Recording(time, step, response.outputs)
    >>> known = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.4), sample_time=0.065)
    >>> fit = dtm.estimate_delay(recording, known, free=("delay", "gain"))
    >>> round(fit.delay, 6), round(fit.gain, 6), fit.verdict
    (0.4, 0.8, 'reliable')

    With an option of the method:

    >>> from deadtime.estimation import Waveform
    >>> fit = dtm.estimate_delay(recording, known, method=Waveform(initial_output=0.0))
    >>> round(fit.delay, 6)
    0.4

    Without a loop, from a command and an output alone:

    >>> rng = np.random.default_rng(1)
    >>> valve = np.where(np.arange(300) < 30, 40.0, 45.0)
    >>> after = np.maximum(np.arange(300) - 42.0, 0.0)
    >>> level = 9.0 * (1.0 - np.exp(-after / 20.0)) + rng.normal(0.0, 0.05, 300)
    >>> bump = dtm.Recording(np.arange(300.0), None, level, valve)
    >>> fit = dtm.estimate_delay(bump)
    >>> fit.verdict, fit.best.name, round(fit.delay)
    ('reliable', 'lag', 12)
    """
    known: dict[str, Any] = {
        "plant": plant,
        "controller": controller,
        "limit": limit,
        "closed_loop": closed_loop,
        "at_rest": at_rest,
        "largest_delay": largest_delay,
        "integrates": integrates,
        "hold": hold,
        "causes": causes,
    }
    if loop is None:
        if method != "auto" or free is not FREE:
            raise ValueError(
                "method and free are for an estimate with a loop: give the loop, or leave both out"
            )
        return estimate_by_evidence(recording, window, {**known, "between": between}, progress)
    given = [name for name, value in known.items() if value is not None]
    if given:
        raise ValueError(
            f"{given[0]} is only for an estimate without a loop: leave out {given[0]} or the loop"
        )
    runs = [checked_run(run) for run in paired_runs(recording, loop, window)]
    chosen = method_of(method, (run.recording for run in runs))
    if len(runs) > 1 and not chosen.joint:
        raise ValueError(
            f"the {chosen.name} method takes one recording, but {len(runs)} are "
            f"given: fit the recordings together by {' or '.join(map(repr, JOINT))}"
        )
    if not isinstance(chosen, OutputError) and not all(run.loop.plant.is_linear for run in runs):
        raise ValueError(
            f"the {chosen.name} method is for linear plants, but this plant limits the rate "
            "of its command. Use method='output_error' and a recording with the logged command"
        )
    of_loop = isinstance(chosen, Waveform)
    if chosen.joint:
        runs = [loop_as_seen(run, of_loop=of_loop) for run in runs]
    found = bound(chosen.estimate(runs, free), runs, of_loop=of_loop)
    if len(runs) > 1 or not (isinstance(chosen, (OutputError, Waveform)) and chosen.rivals):
        return found
    return beside_rivals(found, runs[0], chosen)


#: Findings that the methods refuse themselves, or that some of them can do without.
OWN_REFUSALS = ("no_step", "command_constant", "output_constant")


def checked_run(run: Run) -> Run:
    """The run with what a check finds; refused by name where no estimate would be right.

    A command that was logged one row late or early is moved.
    """
    check = run.recording.check(run.loop, run.window)
    for finding in check.findings:
        if finding.severity == "refused" and finding.code not in OWN_REFUSALS:
            raise NotIdentifiableError(str(finding))
    return command_on_its_row(run, check)


def automatic_method(recordings: Iterable[Recording]) -> str:
    """Name of the method for ``method="auto"``, by whether all recordings have a command."""
    logged = all(recording.command is not None for recording in recordings)
    return "output_error" if logged else "waveform"


def method_of(method: str | Method, recordings: Iterable[Recording]) -> Method:
    """The method object: as it was given, or that of a name with its default options."""
    if isinstance(method, Method):
        return method
    if not isinstance(method, str):
        raise TypeError(
            f"method must be a name or an object such as Waveform(), not {type(method).__name__}"
        )
    name = automatic_method(recordings) if method == "auto" else method
    base.check_choice("method", name, ("auto", *METHODS))
    return METHODS[name]()


#: Share of the 95 % interval of the delay by which a finding may move it unsaid. Larger: intervals
#: hold the truth less often than they say; smaller: answers that hold are doubted.
LEAST_MOVE = 0.25

#: Findings that concern a fit of the loop, and not one of the response to a logged command.
OF_THE_LOOP = ("command_differs", "command_gain", "command_offset", "output_range", "rows_repeated")


def command_on_its_row(run: Run, check: RecordingCheck) -> Run:
    """The run with its command moved, where it was logged one row late or early.

    Commands with times of their own are on no row.
    """
    rows = rows_off(check)
    if run.recording.sent is not None or not rows:
        return run._replace(check=check)
    said = (
        f"the command was logged one row {'late' if rows > 0 else 'early'}, as the equation of "
        f"the controller shows, and was shifted by {shown(check.row_time, math.nan, 's')}"
    )
    recording = on_its_row(run.recording, run.loop, check)
    check = recording.check(run.loop, run.window)
    return run._replace(recording=recording, check=check, corrected=(*run.corrected, said))


def loop_as_seen(run: Run, *, of_loop: bool) -> Run:
    """The run with the sample time that its rows show, and for a fit of the loop the limit."""
    assert run.check is not None
    loop, said = run.loop, list(run.corrected)
    for finding in run.check.findings:
        if finding.severity != "warning":
            continue
        if finding.code == "sample_time_seen":
            seen = run.check.sample_time_seen
            loop = loop.replace(sample_time=seen)
            said.append(f"sampled every {shown(seen or 0.0, math.nan, 's')}, as the rows show")
        elif finding.code == "limit_seen" and of_loop:
            loop = loop.replace(limit=run.check.limit_seen)
            said.append(f"with the limit of {run.check.limit_seen:.6g} that the command shows")
    return run._replace(loop=loop, corrected=tuple(said))


def bound(fit: DelayEstimate, runs: Sequence[Run], *, of_loop: bool) -> DelayEstimate:
    """The estimate with what was put right; an indication where a finding may move the delay."""
    said = dict.fromkeys(words for run in runs for words in run.corrected)
    if said:
        known, begins, reasons = fit.message.partition(REASONS)
        fit = replace(fit, message=f"{'; '.join((known, *said))}{begins}{reasons}")
    doubts = dict.fromkeys(
        f"{finding.message}; {finding.effect}"
        for run in runs
        for finding in (run.check.findings if run.check is not None else ())
        if finding.severity == "warning" and (of_loop or finding.code not in OF_THE_LOOP)
        if _may_move_delay(finding, fit)
    )
    for why in doubts:
        fit = fit.doubted(why)
    return fit


def _may_move_delay(finding: Finding, fit: DelayEstimate) -> bool:
    """Whether a finding may move the delay by more than a share of its interval."""
    moved = finding.shift + finding.share * fit.delay
    if math.isinf(moved) or not moved:
        return bool(moved)
    if "delay" not in fit.free or not fit.calibrated:
        return False
    low, high = fit.ci(0.95)
    return moved > LEAST_MOVE * (high - low)
