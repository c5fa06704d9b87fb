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

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import whole_number
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._extremes import check_dies_out, read_ringing
from deadtime.estimation.data._feedback import FEEDBACK, feedback_p_value
from deadtime.estimation.data._input_output import InputOutput, read_input_output
from deadtime.estimation.data._runs import Run
from deadtime.estimation.data._simulated import SimulatedRecording
from deadtime.estimation.methods._method import Method
from deadtime.estimation.methods._read_off import check_delay_alone, read_off_estimate

__all__ = ["ARXScan"]

Array = NDArray[np.float64]

#: An input that improves on none so much by chance this seldom is one.
CHANCE = 1e-4

#: So many delays, those with the least losses by normal equations, are fitted by least squares.
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

    def __post_init__(self) -> None:
        whole_number("na", self.na, least=0)
        whole_number("nb", self.nb)

    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the one recording."""
        ((recording, loop, window),) = runs
        check_delay_alone("arx_scan", free)
        simulated = SimulatedRecording(recording, loop, window)
        data = simulated.recording
        read = read_input_output(recording, loop, simulated, "arx_scan")
        # Noise that comes back within the same sample is taken for an answer at no delay.
        feedback = feedback_p_value(data) < FEEDBACK
        least = 1 if feedback else 0
        if feedback:
            check_dies_out(read_ringing(data), "arx_scan")
        if self.fractional:
            if read.remark:
                raise ValueError(
                    "fractional=True is for an Integrator or a FirstOrder, which can be undone, "
                    f"the loop has a {type(loop.plant).__name__}: leave it out"
                )
            gain = float(loop.parameters["gain"])
            samples, losses, none = _held_scan(read, float(np.sign(gain)), least)
            numbers, best = 2, float(losses[least:].min())
        else:
            numbers = self.na + self.nb
            losses, best, none = _scan(data.output - data.output[0], read, self.na, self.nb, least)
            samples = float(least + np.argmin(losses[least:]))
        _check_answer(best, none, data.output.size, numbers)
        delay = max(0.0, samples * read.sample_time - (read.late if self.fractional else 0.0))
        order = "the plant undone" if self.fractional else f"na={self.na}, nb={self.nb}"
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
    late = np.zeros(size)
    late[samples:] = values[: size - samples]
    return late


class _Delayed:
    """The command at every delay, lag by lag, and its sums of products: none is kept as an array.

    As many arrays as delays would be as many numbers as samples squared.
    """

    def __init__(self, command: Array, size: int) -> None:
        self.command, self.size = command, size

    def at(self, lag: int) -> Array:
        """The command so many samples later."""
        return _delayed(self.command, lag, self.size)

    def with_target(self, target: Array, lags: int) -> Array:
        """Sum of its products with `target`, for lag 0, 1 and so on."""
        from scipy import signal

        products = signal.correlate(target, self.command, method="fft")
        return np.asarray(products[self.command.size - 1 :][:lags])

    def with_itself(self, apart: int, lags: int) -> Array:
        """Sum of the products of lags 0, 1, … and those so many samples later."""
        products = self.command * _delayed(self.command, apart, self.command.size)
        sums = np.concatenate([[0.0], np.cumsum(products)])
        return sums[np.minimum(self.size - np.arange(lags), self.command.size)]


def _refined(screened: Array, least: int, exact: Callable[[int], float]) -> Array:
    """Losses by normal equations, the least of them again by least squares."""
    losses = screened.copy()
    places = least + np.argsort(screened[least:], kind="stable")
    for place in places[:REFINED]:
        losses[place] = exact(int(place))
    # Rounding of those that are not fitted again does not bring them below these.
    rest = places[REFINED:]
    losses[rest] = np.maximum(losses[rest], losses[places[:REFINED]].max(initial=0.0))
    return losses


def _scan(
    output: Array, read: InputOutput, na: int, nb: int, least: int
) -> tuple[Array, float, float]:
    """Loss for each whole number of samples; that of the best and that without any input.

    The last two have a constant beside: the noise of the first sample shifts all others, which a
    step of the command would explain.
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
        # A held command takes one sample by itself.
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
    """What is left of a target of this power, for each system of normal equations."""
    scale = np.sqrt(np.diagonal(matrix, axis1=1, axis2=2))
    scale = np.where(scale > 0.0, scale, 1.0)
    scaled = matrix / (scale[:, :, None] * scale[:, None, :])
    inverse = np.linalg.pinv(scaled, rcond=1e-13, hermitian=True)
    seen = right / scale
    saved = np.einsum("li,lik,lk->l", seen, inverse, seen)
    return np.asarray(np.maximum(power - saved, 0.0))


def _held_scan(read: InputOutput, sign: float, least: int) -> tuple[float, Array, float]:
    """Best delay in samples, the loss for each whole part of it, and that without any input."""
    answer = sign * read.answer
    inputs = _Delayed(read.command, answer.size)
    none, number = float(answer @ answer), read.longest
    seen = inputs.with_target(answer, number + 1)
    powers = inputs.with_itself(0, number + 1)
    mixed = inputs.with_itself(1, number)
    matrix = np.stack([powers[:-1], mixed, mixed, powers[1:]], axis=1).reshape(-1, 2, 2)
    both = _losses(none, matrix, np.stack([seen[:-1], seen[1:]], axis=1))
    # At one of its ends the share is the best there is where the two have different signs.
    single = none - np.maximum(seen, 0.0) ** 2 / np.where(powers > 0.0, powers, 1.0)
    inside = _cramer(matrix, seen)
    screened = np.where(inside, both, np.minimum(single[:-1], single[1:]))

    def fitted(late: int) -> tuple[float, float]:
        now, before = inputs.at(late), inputs.at(late + 1)
        weights = np.linalg.lstsq(np.stack([now, before], axis=1), answer, rcond=None)[0]
        if min(weights) < 0.0:
            single = [max(0.0, float(x @ answer)) / float(x @ x or 1.0) for x in (now, before)]
            saved = [
                weight**2 * float(x @ x) for weight, x in zip(single, (now, before), strict=True)
            ]
            weights = np.array([single[0], 0.0] if saved[0] >= saved[1] else [0.0, single[1]])
        loss = float(np.sum((answer - weights[0] * now - weights[1] * before) ** 2))
        total = float(weights.sum())
        return loss, float(weights[1]) / total if total > 0.0 else 0.0

    losses = _refined(np.maximum(screened, 0.0), least, lambda late: fitted(late)[0])
    best = least + int(np.argmin(losses[least:]))
    return best + fitted(best)[1], losses, none


def _cramer(matrix: Array, seen: Array) -> NDArray[np.bool_]:
    """Whether both weights of each pair of delays are positive, by Cramer's rule."""
    first = seen[:-1] * matrix[:, 1, 1] - seen[1:] * matrix[:, 0, 1]
    second = seen[1:] * matrix[:, 0, 0] - seen[:-1] * matrix[:, 0, 1]
    return np.asarray((first >= 0.0) & (second >= 0.0))


def _check_answer(least: float, none: float, samples: int, numbers: int) -> None:
    """Refuse where the command improves the model no more than chance does."""
    from scipy import special

    freedom = max(1, samples - numbers)
    ratio = (none - least) / 2.0 / max(least / freedom, 1e-300)
    if float(special.fdtrc(2, freedom, max(ratio, 0.0))) > CHANCE:
        raise NotIdentifiableError(
            f"with the command the loss falls from {none:.3g} to {least:.3g}, no more than by "
            "chance: the output is no answer to this command, or the noise drowns it; check "
            "columns and units, or excite more"
        )
