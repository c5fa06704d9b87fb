"""The effect of noise in the loop.

Where a controller acts on the error r - y alone, noise on the output is noise on the reference
with the other sign, limit and hold included. Where it differentiates the output alone, as PV
does, the noise goes through the filter of the derivative as well: u = Kp (r - y - n) - Kv H (y + n)
is what it makes of y under the reference r - n - (Kv/Kp) H n, computed exactly on the samples.

As the plant is linear, its output is the response to the command plus the effect of the air. So the
controller acts on the air as on noise of the sensor. The difference is that the vehicle really
moves: the air is always in the loop. It also moves between the samples, so it is refused for
controllers that act on the output there: continuous ones, and those whose integral or filter is.
"""

from __future__ import annotations

import numpy as np

from deadtime._base.arrays import Array
from deadtime.experiments._noise import DisturbanceModel, NoiseModel, Seed
from deadtime.loops import PV, ControlLoop, DerivativeFilter, discretised


def disturbance_of(model: NoiseModel, time: Array, seed: Seed, loop: ControlLoop) -> Array:
    """What a model adds to the output by moving the plant."""
    if not isinstance(model, DisturbanceModel):
        return np.zeros(time.size)
    found = model.disturbance(time, seed, loop.plant)
    if found.any():
        check_reads_samples(loop)
    return found


def check_reads_samples(loop: ControlLoop) -> None:
    """Refuse controllers that act on the output between the samples."""
    gains, smooth = loop.controller.gains, loop.controller._filter
    if loop.sample_time is None:
        why, advice = "a continuous controller", "give the loop a sample_time"
    elif gains.get("Ki", 0.0) != 0.0:
        why, advice = "the integral of the controller", "use a controller without Ki"
    elif smooth is not None and smooth.discretisation is None:
        why = "the continuous filter of the controller"
        advice = "give the DerivativeFilter a discretisation"
    else:
        return
    raise ValueError(
        f"{why} responds to wind (air) between the samples, and this response cannot be "
        f"computed: {advice}, or leave air and trim out of the noise"
    )


def reference_shift(error: Array, loop: ControlLoop) -> Array:
    """What the reference has to be lowered by to have the effect of noise on the output."""
    controller = loop.controller
    gains, smooth = controller.gains, controller._filter
    slope = gains.get("Kd", gains.get("Kv", 0.0))
    if slope == 0.0:
        return error
    if smooth is None:
        raise ValueError(
            "the ideal derivative of noise does not exist: give the controller a "
            "DerivativeFilter, or use noise_in_loop=False"
        )
    if not isinstance(controller, PV):
        return error
    if loop.sample_time is None:
        raise ValueError(
            "the noise behind the filter of a PV controller is known only for a sampled loop: give "
            "the loop a sample_time, or use noise_in_loop=False"
        )
    if controller.Kp == 0.0:
        raise ValueError(
            "with Kp=0 the reference has no effect, so noise cannot be added to the reference. "
            "Give another Kp, or use noise_in_loop=False"
        )
    return error + slope / controller.Kp * _derivative(error, smooth, loop.sample_time)


def _derivative(error: Array, smooth: DerivativeFilter, sample_time: float) -> Array:
    """The filtered derivative of noise at the samples.

    The noise is held from sample to sample, for which the hold discretisation of a continuous
    filter is exact.
    """
    from scipy import signal

    omega, damping = smooth.omega, smooth.damping
    found = discretised(
        np.array([[0.0, omega], [-omega, -2.0 * damping * omega]]),
        np.array([0.0, omega]),
        np.array([0.0, omega]),
        sample_time,
        smooth.discretisation or "hold",
    )
    num, den = signal.ss2tf(found.F, found.G[:, None], found.C[None, :], np.array([[found.D]]))
    return np.asarray(signal.lfilter(num[0], den, error), dtype=np.float64)
