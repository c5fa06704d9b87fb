"""ARX models with every whole number of samples of input delay, as MATLAB's `delayest` fits them.

    y_k + a_1 y_{k-1} + … = b_1 u_{k-n} + b_2 u_{k-n-1} + … + e_k

is fitted by least squares for each n, and the n with the least loss is the delay, (n - 1) samples
besides the one that a held command takes by itself (Ljung 1999, section 10.1; MATLAB's `delayest`
and `arxstruc`, na = nb = 2). Before the record, all is taken to be at rest.

With `fractional` the plant is taken as known and inverted, so that no a remains. Under the hold, a
delay of (d + f) samples then gives b_1 : b_2 = (1 - f) : f; both are constrained to the sign of the
gain.

Sensor noise does not enter as e does: least squares is biased, more so with more noise, and in a
closed loop the command depends on the noise. There is no interval; the method is for comparison.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import whole_number
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._input_output import (
    FEEDBACK,
    InputOutput,
    feedback_p_value,
    read_input_output,
)
from deadtime.estimation.data._simulated import SimulatedRecording
from deadtime.estimation.data._step_reading import check_decays, read_ringing
from deadtime.estimation.methods._conclusion import check_delay_alone, read_off_estimate
from deadtime.estimation.methods._method import Method, Run

#: Significance level of the F test that the command improves the model.
F_TEST_LEVEL = 1e-4

#: Number of delays, those with the least losses by normal equations, that are refitted by least
#: squares. Normal equations are fast and lose half of the digits.
REFINED = 100


@dataclass(frozen=True)
class ARXScan(Method):
    """Delay of the ARX model with the least loss, as MATLAB's `delayest` finds it.

    Parameters
    ----------
    na, nb : int
        Number of coefficients of past outputs, and of past commands.
    fractional : bool
        Invert the known plant, and find the delay between samples too; `na` and `nb` are not used.

    Raises
    ------
    ValueError
        When `na` is negative or `nb` below 1.
    """

    na: int = 2
    nb: int = 2
    fractional: bool = False

    name: ClassVar[str] = "arx_scan"
    limits: ClassVar[str] = (
        "The delay is a whole number of samples, and noise of the sensor biases the coefficients "
        "of the ARX models, under feedback more so."
    )

    def __post_init__(self) -> None:
        whole_number("na", self.na, least=0)
        whole_number("nb", self.nb)

    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the one recording."""
        ((recording, loop, window, *_),) = runs
        check_delay_alone("arx_scan", free)
        simulated = SimulatedRecording(recording, loop, window)
        data = simulated.recording
        read = read_input_output(simulated, "arx_scan")
        # Feedback within the same sample looks like a response without delay.
        feedback = feedback_p_value(data) < FEEDBACK
        least = 1 if feedback else 0
        if feedback:
            check_decays(read_ringing(data), "arx_scan")
        if self.fractional:
            if read.remark:
                raise ValueError(
                    "fractional=True is for an Integrator or a FirstOrder, which can be inverted, "
                    f"the loop has a {type(loop.plant).__name__}: leave it out"
                )
            gain = float(loop.parameters["gain"])
            samples, losses, none = _held_scan(read, float(np.sign(gain)), least)
            numbers, tested, best = 2, 2, float(losses[least:].min())
        else:
            numbers, tested = self.na + self.nb, self.nb
            losses, best, none = _scan(data.output - data.output[0], read, self.na, self.nb, least)
            samples = float(least + np.argmin(losses[least:]))
        _check_response(best, none, data.output.size - numbers, tested)
        delay = max(0.0, samples * read.sample_time - (read.late if self.fractional else 0.0))
        order = "the plant inverted" if self.fractional else f"na={self.na}, nb={self.nb}"
        return read_off_estimate(
            "arx_scan",
            simulated,
            {"delay": delay},
            None,
            float(data.output[0]),
            message=(
                f"ARX models, {order}: least loss at {samples:.4g} samples of {read.sample_time:g} "
                "s"
            ),
            uncalibrated=(
                "an ARX scan compares losses: the delay is not a coefficient with an error, a "
                "whole number of samples has none, and sensor noise biases the coefficients; use "
                "method='output_error' for an interval"
            ),
            details={
                "samples": samples,
                "delays": [read.sample_time * late for late in range(losses.size)],
                "losses": losses.tolist(),
            },
        )


def _delayed(values: Array, samples: int, size: int) -> Array:
    """The values, delayed by whole samples, with zeros before the first one."""
    late = np.zeros(size)
    late[samples:] = values[: size - samples]
    return late


class _Delayed:
    """The command at every delay, and its sums of products, without keeping them as arrays.

    An array for each delay would take memory proportional to the square of the samples.
    """

    def __init__(self, command: Array, size: int) -> None:
        self.command, self.size = command, size

    def at(self, lag: int) -> Array:
        """The command, delayed by `lag` samples."""
        return _delayed(self.command, lag, self.size)

    def with_target(self, target: Array, lags: int) -> Array:
        """Sums of products with `target`, for each of the first `lags` delays."""
        from scipy import signal

        products = signal.correlate(target, self.command, method="fft")
        return np.asarray(products[self.command.size - 1 :][:lags])

    def with_itself(self, apart: int, lags: int) -> Array:
        """Sums of products of each of the first `lags` delays and that `apart` samples later."""
        products = self.command * _delayed(self.command, apart, self.command.size)
        sums = np.concatenate([[0.0], np.cumsum(products)])
        return sums[np.minimum(self.size - np.arange(lags), self.command.size)]


def _refined(screened: Array, least: int, exact: Callable[[int], float]) -> Array:
    """Losses by normal equations; the least of them recomputed by least squares."""
    losses = screened.copy()
    places = least + np.argsort(screened[least:], kind="stable")
    for place in places[:REFINED]:
        losses[place] = exact(int(place))
    # Rounding in the other losses must not bring them below the recomputed ones.
    rest = places[REFINED:]
    losses[rest] = np.maximum(losses[rest], losses[places[:REFINED]].max(initial=0.0))
    return losses


def _scan(
    output: Array, read: InputOutput, na: int, nb: int, least: int
) -> tuple[Array, float, float]:
    """Loss for each whole number of samples; that of the best, and that without any input.

    The last two models have a constant term too: the noise of the first sample shifts all others,
    and a step of the command could otherwise explain that shift.
    """
    size, number = output.size, read.longest
    past = [_delayed(output, lag, size) for lag in range(1, na + 1)]
    inputs = _Delayed(read.command, size)

    def loss(columns: list[Array]) -> float:
        if not columns:
            return float(output @ output)
        matrix = np.stack(columns, axis=1)
        weights = np.linalg.lstsq(matrix, output, rcond=None)[0]
        return float(np.sum((output - matrix @ weights) ** 2))

    def delayed(late: int) -> list[Array]:
        # The hold itself delays by one sample.
        return [inputs.at(late + 1 + lag) for lag in range(nb)]

    order = na + nb
    matrix, right = np.zeros((number, order, order)), np.zeros((number, order))
    for i, one in enumerate(past):
        right[:, i] = one @ output
        for k, other in enumerate(past):
            matrix[:, i, k] = one @ other
        products = inputs.with_target(one, number + nb)
        for lag in range(nb):
            matrix[:, i, na + lag] = matrix[:, na + lag, i] = products[1 + lag :][:number]
    products = inputs.with_target(output, number + nb)
    for lag in range(nb):
        right[:, na + lag] = products[1 + lag :][:number]
    for apart in range(nb):
        products = inputs.with_itself(apart, number + nb)
        for lag in range(nb - apart):
            sums = products[1 + lag :][:number]
            matrix[:, na + lag, na + lag + apart] = matrix[:, na + lag + apart, na + lag] = sums
    screened = _losses(float(output @ output), matrix, right)
    losses = _refined(screened, least, lambda late: loss([*past, *delayed(late)]))
    place = least + int(np.argmin(losses[least:]))
    constant = [*past, np.ones(size)]
    return losses, loss([*constant, *delayed(place)]), loss(constant)


def _losses(power: float, matrix: Array, right: Array) -> Array:
    """Residual sum of squares of a target of this power, for each system of normal equations."""
    scale = np.sqrt(np.diagonal(matrix, axis1=1, axis2=2))
    scale = np.where(scale > 0.0, scale, 1.0)
    scaled = matrix / (scale[:, :, None] * scale[:, None, :])
    inverse = np.linalg.pinv(scaled, rcond=1e-13, hermitian=True)
    seen = right / scale
    explained = np.einsum("li,lik,lk->l", seen, inverse, seen)
    return np.asarray(np.maximum(power - explained, 0.0))


def _held_scan(read: InputOutput, sign: float, least: int) -> tuple[float, Array, float]:
    """Best delay in samples, the loss for each whole number of them, and that without input."""
    response = sign * read.response
    inputs = _Delayed(read.command, response.size)
    none, number = float(response @ response), read.longest
    seen = inputs.with_target(response, number + 1)
    powers = inputs.with_itself(0, number + 1)
    mixed = inputs.with_itself(1, number)
    matrix = np.stack([powers[:-1], mixed, mixed, powers[1:]], axis=1).reshape(-1, 2, 2)
    both = _losses(none, matrix, np.stack([seen[:-1], seen[1:]], axis=1))
    # Where the unconstrained weights have different signs, the best has one weight of zero.
    single = none - np.maximum(seen, 0.0) ** 2 / np.where(powers > 0.0, powers, 1.0)
    # Both weights are positive, by Cramer's rule.
    first = seen[:-1] * matrix[:, 1, 1] - seen[1:] * matrix[:, 0, 1]
    second = seen[1:] * matrix[:, 0, 0] - seen[:-1] * matrix[:, 0, 1]
    inside = (first >= 0.0) & (second >= 0.0)
    screened = np.where(inside, both, np.minimum(single[:-1], single[1:]))

    def fitted(late: int) -> tuple[float, float]:
        now, before = inputs.at(late), inputs.at(late + 1)
        weights = np.linalg.lstsq(np.stack([now, before], axis=1), response, rcond=None)[0]
        if min(weights) < 0.0:
            single = [max(0.0, float(x @ response)) / float(x @ x or 1.0) for x in (now, before)]
            saved = [
                weight**2 * float(x @ x) for weight, x in zip(single, (now, before), strict=True)
            ]
            weights = np.array([single[0], 0.0] if saved[0] >= saved[1] else [0.0, single[1]])
        loss = float(np.sum((response - weights[0] * now - weights[1] * before) ** 2))
        total = float(weights.sum())
        return loss, float(weights[1]) / total if total > 0.0 else 0.0

    losses = _refined(np.maximum(screened, 0.0), least, lambda late: fitted(late)[0])
    best = least + int(np.argmin(losses[least:]))
    return best + fitted(best)[1], losses, none


def _check_response(least: float, none: float, freedom: int, tested: int) -> None:
    """Refuse where the command, with `tested` coefficients, improves no more than noise would."""
    from scipy import special

    freedom = max(1, freedom)
    ratio = (none - least) / tested / max(least / freedom, 1e-300)
    if float(special.fdtrc(tested, freedom, max(ratio, 0.0))) > F_TEST_LEVEL:
        raise NotIdentifiableError(
            f"with the command the loss falls from {none:.3g} to {least:.3g}, no more than "
            "with noise: the output is no response to this command, or the noise hides it; check "
            "columns and units, or excite more"
        )
