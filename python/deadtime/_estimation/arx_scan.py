"""ARX models over every whole number of samples of input delay: what `delayest` does.

    y_k + a_1 y_{k-1} + … = b_1 u_{k-n} + b_2 u_{k-n-1} + … + e_k

is fitted by least squares for each n, and the n with the least loss is the delay, (n - 1) samples
besides the one that a held command takes by itself (Ljung 1999, section 10.1; MATLAB's `delayest`
and `arxstruc`, na = nb = 2). Before the record, all is taken to be at rest.

With `fractional` the plant is taken as known and undone, so that no a is left, and the hold leaves
a delay of (d + f) samples as b_1 : b_2 = (1 - f) : f; both are kept from having the wrong sign.

Sensor noise does not enter as e does: least squares is biased, the more the noise, and in a loop
the command follows it. There is no interval; the method is here to compare with.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import special

from deadtime._errors import NotIdentifiableError
from deadtime._estimation.extremes import check_dies_out, read_ringing
from deadtime._estimation.feedback import FEEDBACK, feedback_p_value
from deadtime._estimation.input_output import InputOutput, read_input_output
from deadtime._estimation.read_off import check_delay_alone, read_off_estimate
from deadtime._estimation.result import DelayEstimate
from deadtime._estimation.simulated import SimulatedRecording
from deadtime._loop import ControlLoop
from deadtime._recording import Recording
from deadtime._validation import whole_number

__all__ = ["estimate_by_arx_scan"]

Array = NDArray[np.float64]

#: An input that improves on none so much by chance this seldom is one.
CHANCE = 1e-4


def estimate_by_arx_scan(
    recording: Recording,
    loop: ControlLoop,
    window: tuple[float | None, float | None] | None,
    free: Sequence[str] = ("delay",),
    na: int = 2,
    nb: int = 2,
    fractional: bool = False,
) -> DelayEstimate:
    """Delay of the ARX model with the least loss."""
    check_delay_alone("arx_scan", free)
    simulated = SimulatedRecording(recording, loop, window)
    data = simulated.recording
    read = read_input_output(recording, loop, simulated, "arx_scan")
    # Noise that comes back within the same sample is taken for an answer at no delay.
    feedback = feedback_p_value(data) < FEEDBACK
    least = 1 if feedback else 0
    if feedback:
        check_dies_out(read_ringing(data), "arx_scan")
    if fractional:
        if read.remark:
            raise ValueError(
                f"fractional=True is for an Integrator or a FirstOrder, which can be undone, the "
                f"loop has a {type(loop.plant).__name__}: leave it out"
            )
        gain = float(loop.parameters["gain"])
        samples, losses, none = _held_scan(read, float(np.sign(gain)), least)
        numbers, best = 2, float(losses[least:].min())
    else:
        poles, zeros = whole_number("na", na, least=0), whole_number("nb", nb, least=1)
        numbers = poles + zeros
        losses, best, none = _scan(data.output - data.output[0], read, poles, zeros, least)
        samples = float(least + np.argmin(losses[least:]))
    _check_answer(best, none, data.output.size, numbers)
    delay = max(0.0, samples * read.sample_time - (read.late if fractional else 0.0))
    order = "the plant undone" if fractional else f"na={na}, nb={nb}"
    return read_off_estimate(
        "arx_scan",
        simulated,
        {"delay": delay},
        None,
        float(data.output[0]),
        message=(
            f"ARX models, {order}: least loss at {samples:.4g} samples of {read.sample_time:g} s"
        ),
        uncalibrated=(
            "an ARX scan compares losses: the error of the delay is no coefficient's, a whole "
            "number of samples has none, and sensor noise biases the coefficients; use "
            "method='output_error' for an interval"
        ),
        details={
            "samples": samples,
            "delays": [read.sample_time * late for late in range(losses.size)],
            "losses": losses.tolist(),
        },
    )


def _delayed(values: Array, samples: int, size: int) -> Array:
    """The values so many samples later, zero before they begin."""
    return np.concatenate([np.zeros(samples), values])[:size]


def _scan(
    output: Array, read: InputOutput, na: int, nb: int, least: int
) -> tuple[Array, float, float]:
    """Loss for each whole number of samples; that of the best and that without any input.

    The last two have a constant beside: the noise of the first sample shifts all others, which a
    step of the command would explain.
    """
    size = output.size
    past = [_delayed(output, lag, size) for lag in range(1, na + 1)]

    def loss(columns: list[Array]) -> float:
        if not columns:
            return float(output @ output)
        matrix = np.stack(columns, axis=1)
        weights = np.linalg.lstsq(matrix, output, rcond=None)[0]
        return float(np.sum((output - matrix @ weights) ** 2))

    # A held command takes one sample by itself.
    inputs = [_delayed(read.command, lag + 1, size) for lag in range(read.longest + nb)]
    losses = [loss([*past, *inputs[late : late + nb]]) for late in range(read.longest)]
    place = least + int(np.argmin(losses[least:]))
    constant = [*past, np.ones(size)]
    return np.array(losses), loss([*constant, *inputs[place : place + nb]]), loss(constant)


def _held_scan(read: InputOutput, sign: float, least: int) -> tuple[float, Array, float]:
    """Best delay in samples, the loss for each whole part of it, and that without any input."""
    answer, size = sign * read.answer, read.answer.size
    inputs = [_delayed(read.command, lag, size) for lag in range(read.longest + 1)]
    none = float(answer @ answer)
    losses, shares = [], []
    for now, before in itertools.pairwise(inputs):
        weights = np.linalg.lstsq(np.stack([now, before], axis=1), answer, rcond=None)[0]
        if min(weights) < 0.0:  # at one of its ends the share is the best there is
            single = [max(0.0, float(x @ answer)) / float(x @ x or 1.0) for x in (now, before)]
            saved = [
                weight**2 * float(x @ x) for weight, x in zip(single, (now, before), strict=True)
            ]
            weights = np.array([single[0], 0.0] if saved[0] >= saved[1] else [0.0, single[1]])
        losses.append(float(np.sum((answer - weights[0] * now - weights[1] * before) ** 2)))
        total = float(weights.sum())
        shares.append(float(weights[1]) / total if total > 0.0 else 0.0)
    best = least + int(np.argmin(losses[least:]))
    return best + shares[best], np.array(losses), none


def _check_answer(least: float, none: float, samples: int, numbers: int) -> None:
    """Refuse where the command improves the model no more than chance does."""
    freedom = max(1, samples - numbers)
    ratio = (none - least) / 2.0 / max(least / freedom, 1e-300)
    if float(special.fdtrc(2, freedom, max(ratio, 0.0))) > CHANCE:
        raise NotIdentifiableError(
            f"with the command the loss falls from {none:.3g} to {least:.3g}, no more than by "
            "chance: the output is no answer to this command, or the noise drowns it; check "
            "columns and units, or excite more"
        )
