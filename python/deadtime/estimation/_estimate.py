"""The door to the estimators."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._evidence import check_setpoint_active
from deadtime.estimation.data._several import Flights, Window, each_flight
from deadtime.estimation.methods._arx_scan import estimate_by_arx_scan
from deadtime.estimation.methods._cta import estimate_by_cta
from deadtime.estimation.methods._decay import estimate_by_decay
from deadtime.estimation.methods._decrement import estimate_by_decrement
from deadtime.estimation.methods._frequency import estimate_by_frequency
from deadtime.estimation.methods._gcc import estimate_by_gcc
from deadtime.estimation.methods._graphical import estimate_by_graphical
from deadtime.estimation.methods._grid import estimate_by_grid
from deadtime.estimation.methods._output_error import estimate_by_output_error
from deadtime.estimation.methods._overshoot import estimate_by_overshoot
from deadtime.estimation.methods._relay import estimate_by_relay
from deadtime.estimation.methods._waveform import estimate_by_waveform
from deadtime.loops import ControlLoop

__all__ = ["METHODS", "estimate_delay"]

_Estimator: TypeAlias = Callable[..., DelayEstimate]

#: The methods by name. Each takes recording, loop, window and free, then its own options by name.
METHODS: Mapping[str, _Estimator] = {
    "output_error": estimate_by_output_error,
    "waveform": estimate_by_waveform,
    "frequency": estimate_by_frequency,
    "grid": estimate_by_grid,
    "cta": estimate_by_cta,
    "overshoot": estimate_by_overshoot,
    "decrement": estimate_by_decrement,
    "decay": estimate_by_decay,
    "graphical": estimate_by_graphical,
    "relay": estimate_by_relay,
    "gcc": estimate_by_gcc,
    "arx_scan": estimate_by_arx_scan,
}

#: Those that fit several recordings together.
JOINT = ("output_error", "waveform")


def estimate_delay(
    recording: Flights,
    loop: ControlLoop | Sequence[ControlLoop],
    *,
    method: str = "auto",
    free: Sequence[str] = ("delay", "gain"),
    window: Window = None,
    **options: Any,
) -> DelayEstimate:
    """Estimate the delay of a closed loop from a recording of it.

    Parameters
    ----------
    recording : Recording or list of Recording
        Reference and output over time, as logged where the controller runs. Several flights of
        one vehicle are fitted together, by ``"output_error"`` and ``"waveform"``.
    loop : ControlLoop or list of ControlLoop
        What is known: plant, controller gains, sample time, limit; the delay is None or a guess.
        One for all recordings, or one each.
    method : str
        What the delay is found from.

        - ``"output_error"``: the response of the vehicle to the command as it was logged. On the
          Cramér-Rao bound; what ``"auto"`` takes where the recordings have a command.
        - ``"waveform"``: the response of the whole loop, simulated. ``"auto"`` takes it elsewhere.
        - ``"frequency"``: maximum likelihood at the lines of a spectrum, for periodic experiments.
        - ``"grid"``: the cost over a range of delays, kept as a curve; ``"cta"``: the waveform
          with Chebyshev's approximation of the delay.
        - ``"overshoot"``: one number, as Armah & Yi did; ``"decrement"``: successive peaks;
          ``"decay"``: the tail where nothing overshoots; ``"graphical"``: the beginning of a step.
        - ``"relay"``: the period of a limit cycle.
        - ``"gcc"``: generalised cross-correlation; ``"arx_scan"``: what `delayest` does.
    free : sequence of str
        What is fitted, any of ``"delay"``, ``"gain"``, ``"lag"`` and ``"time_constant"``, as the
        plant has them; ``"waveform"`` also fits ``"limit"`` and ``"start"``, how much later than
        that of the reference the clock of the output runs. ``"decrement"`` fits delay and gain;
        ``"overshoot"``, ``"decay"``, ``"graphical"``, ``"relay"``, ``"gcc"`` and ``"arx_scan"``
        the delay alone, and take what else they need as given.
    window : (float or None, float or None) or list of them, optional
        The part to use, s: one for all recordings, or a list with one each. For ``"waveform"``,
        ``"grid"``, ``"cta"`` and all that read a step it should begin at rest and hold one step;
        ``"output_error"``, ``"frequency"``, ``"gcc"`` and ``"arx_scan"`` take any in which the
        command changes.
    **options
        Options of the method.

        - ``initial_output``: the true output at the start, where it is known and need not be
          fitted (``"output_error"``, ``"waveform"``, ``"grid"``, ``"cta"``).
        - ``noise`` (``"waveform"``): ``"recording"`` where noise is in the recording alone,
          ``"loop"`` where the controller saw it, too; ``"auto"`` takes the latter for rows that
          are the samples of a P controller, unless the former is likelier by far.
        - ``period`` of the excitation, s, with ``left_out=1`` periods of transient, and
          ``highest``, Hz (``"frequency"``).
        - ``delays`` to try, s (``"grid"``); ``intervals=8`` (``"cta"``).
        - ``map`` (``"overshoot"``): ``"dominant"`` (the paper's), ``"exact"`` (the exact step
          response) or ``"saturated"`` (the loop simulated with its hold and limit).
        - ``tail=0.3``, the share of the step that is left where the tail begins (``"decay"``).
        - ``construction`` (``"graphical"``): ``"tangent"``, ``"two_point"`` (with two ``shares``)
          or ``"first_movement"``.
        - ``amplitude`` of the relay where no command was logged (``"relay"``).
        - ``weighting`` (``"gcc"``): ``"none"``, ``"scot"``, ``"phat"`` or ``"prewhitened"``.
        - ``na=2``, ``nb=2``, ``fractional=False`` (``"arx_scan"``).

    Returns
    -------
    DelayEstimate

    Raises
    ------
    NotIdentifiableError
        When the recording does not determine what was asked for: no step, no overshoot
        (Kp·Td below 1/e), an output that noise alone would explain, a setpoint that copies the
        output, a limit cycle where the method is of linear theory, numbers that cannot be told
        apart.
    RecordingError
        When the window holds too few samples.
    ValueError
        For a method, option or free quantity that does not exist.

    Notes
    -----
    A ground station sees the sum of all delays on the way round the loop; from its own log,
    which part is in the command and which in the measurement cannot be told. A model that does
    not explain the recording is returned with ``adequate=False``, not refused. Several recordings
    count by the inverse of their noise where residuals are white, and by that of their excitation
    where they are not.

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
    >>> flown = truth.simulate(time, step, reference_time=time)
    >>> flight = dtm.Recording(time, step, flown.outputs)
    >>> known = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.4), sample_time=0.065)
    >>> fit = dtm.estimate_delay(flight, known, free=("delay", "gain"))
    >>> round(fit.delay, 6), round(fit.gain, 6), fit.adequate
    (0.4, 0.8, True)
    """
    flights = each_flight(recording, loop, window)
    for one in flights:
        check_setpoint_active(one.recording.window(*(one.window or (None, None))))
    if method == "auto":
        logged = all(one.recording.command is not None for one in flights)
        method = "output_error" if logged else "waveform"
    if method not in METHODS:
        raise ValueError(
            f"method={method!r} is not one of {', '.join(map(repr, ('auto', *METHODS)))}"
        )
    estimator = METHODS[method]
    _check_options(method, estimator, options)
    if method in JOINT:
        return estimator(recording, loop, window, free, **options)
    if len(flights) > 1:
        raise ValueError(
            f"the {method} method takes one recording, not {len(flights)}: fit them together by "
            f"{' or '.join(map(repr, JOINT))}"
        )
    (flight,) = flights
    return estimator(flight.recording, flight.loop, flight.window, free, **options)


def _check_options(method: str, estimator: _Estimator, options: Mapping[str, Any]) -> None:
    """Refuse options that the method has not, naming those it has."""
    known = list(inspect.signature(estimator).parameters)[4:]
    for name in options:
        if name not in known:
            has = f"its options are {', '.join(map(repr, known))}" if known else "it has none"
            raise ValueError(f"the {method} method has no option {name!r}: {has}")
