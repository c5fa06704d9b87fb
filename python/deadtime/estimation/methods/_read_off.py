"""Results of methods that read the delay from a few features of the response.

The residuals of the loop with the estimated parameters are computed as for every other method, so
they show how well it explains the whole recording.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._evidence import standard_errors
from deadtime.estimation.data._excitation import ROUNDING
from deadtime.estimation.data._simulated import SimulatedRecording
from deadtime.estimation.fit._residuals import whiteness_of
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

__all__ = ["check_delay_alone", "estimate_with_residuals", "read_off_estimate"]


def check_delay_alone(method: str, free: Sequence[str]) -> None:
    """Refuse `free` without the delay; its other names are taken as given."""
    if "delay" not in free:
        raise ValueError(
            f"the {method} method determines the delay alone, and free={tuple(free)!r} does not "
            "ask for it"
        )


def read_off_estimate(
    method: str,
    simulated: SimulatedRecording,
    values: Mapping[str, float],
    cov: NDArray[np.float64] | None,
    start: float,
    *,
    message: str,
    uncalibrated: str,
    details: Mapping[str, Any],
) -> DelayEstimate:
    """The result for these `values`, with the loop at rest at the output `start`.

    Without a covariance the standard errors are NaN.
    """
    try:
        residuals = simulated.residuals(values, start)
    except ValueError as error:
        found = ", ".join(f"{name} {value:.4g}" for name, value in values.items())
        raise NotIdentifiableError(
            f"the {method} method reads {found}, and a loop with these values cannot have been "
            f"recorded ({error}): check gains, signs and units"
        ) from None
    return estimate_with_residuals(
        method,
        simulated.loop,
        simulated.recording,
        values,
        cov,
        residuals,
        message=message,
        uncalibrated=uncalibrated,
        details=details,
    )


def estimate_with_residuals(
    method: str,
    loop: ControlLoop,
    recording: Recording,
    values: Mapping[str, float],
    cov: NDArray[np.float64] | None,
    residuals: NDArray[np.float64],
    *,
    message: str,
    uncalibrated: str,
    details: Mapping[str, Any],
) -> DelayEstimate:
    """The result for these `values` of a method that has its own residuals."""
    names = tuple(values)
    if cov is None:
        cov = np.full((len(names), len(names)), np.nan)
    whiteness = whiteness_of(residuals, len(names))
    exact = float(np.max(np.abs(residuals))) <= ROUNDING * float(np.ptp(recording.output))
    return DelayEstimate(
        method=method,
        loop=loop.replace(**values),
        free=names,
        stderr=standard_errors(names, cov),
        cov=cov,
        crb=None,
        recording=recording,
        residuals=residuals,
        whiteness=whiteness,
        adequate=whiteness.white or exact,
        message=message,
        uncalibrated=uncalibrated,
        details=details,
    )
