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

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import whole_number
from deadtime.estimation._native import arx_losses, held_losses
from deadtime.estimation.data._input_output import first_shift, read_input_output
from deadtime.estimation.methods._method import OfOne, Read, Run

#: Significance level of the F test that the command improves the model.
F_TEST_LEVEL = 1e-4


@dataclass(frozen=True)
class ARXScan(OfOne):
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
        "Without fractional=True the delay is a whole number of samples. Sensor noise "
        "biases the coefficients of the ARX models, especially in a closed loop."
    )

    def __post_init__(self) -> None:
        whole_number("na", self.na, least=0)
        whole_number("nb", self.nb)

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        loop, simulated = run.loop, run.simulated
        data = simulated.recording
        read = read_input_output(simulated, "arx_scan")
        _, least = first_shift(data, "arx_scan")
        if self.fractional:
            if read.remark:
                raise ValueError(
                    "fractional=True needs an Integrator or a "
                    "FirstOrder, which can be inverted, but the loop has "
                    f"a {type(loop.plant).__name__}: leave fractional out"
                )
            gain = float(loop.parameters["gain"])
            response = np.sign(gain) * read.response
            samples, losses, none = held_losses(response, read.command, (least, read.longest))
            numbers, tested, best = 2, 2, float(losses[least:].min())
        else:
            numbers, tested = self.na + self.nb, self.nb
            losses, best, none = arx_losses(
                data.output - data.output[0],
                read.command,
                (self.na, self.nb),
                (least, read.longest),
            )
            samples = float(least + np.argmin(losses[least:]))
        _check_response(best, none, data.output.size - numbers, tested)
        delay = max(0.0, samples * read.sample_time - (read.late if self.fractional else 0.0))
        order = "the plant inverted" if self.fractional else f"na={self.na}, nb={self.nb}"
        return Read(
            {"delay": delay},
            None,
            float(data.output[0]),
            message=(
                f"ARX models, {order}: least loss at {samples:.4g} samples of {read.sample_time:g} "
                "s"
            ),
            uncalibrated=(
                "an ARX scan chooses the delay with the smallest loss, so "
                "it has no standard error. Sensor noise also biases the "
                "coefficients. Use method='output_error' for an interval"
            ),
            details={
                "samples": samples,
                "delays": [read.sample_time * late for late in range(losses.size)],
                "losses": losses.tolist(),
            },
        )


def _check_response(least: float, none: float, freedom: int, tested: int) -> None:
    """Refuse where the command, with `tested` coefficients, improves no more than noise would."""
    from scipy import special

    freedom = max(1, freedom)
    ratio = (none - least) / tested / max(least / freedom, 1e-300)
    if float(special.fdtrc(tested, freedom, max(ratio, 0.0))) > F_TEST_LEVEL:
        raise NotIdentifiableError(
            f"with the command, the loss falls only from {none:.3g} to {least:.3g}, as it "
            "does for noise. Either the output does not respond to this command, or noise "
            "hides the response. Check columns and units, or use a larger excitation"
        )
