"""One estimate a run, asked for as a user would, beside the truth of the run."""

from __future__ import annotations

import math
import time
import warnings
from dataclasses import asdict, dataclass
from typing import Any

import deadtime as dtm
import numpy as np

from strangers.faults import named_size, nothing
from strangers.linear import Array
from strangers.plants import Runs, drawn
from strangers.rows import Row
from strangers.simulate import Logs, logged
from strangers.truth import QUANTITIES, truth_of


@dataclass(frozen=True)
class Estimate:
    """One estimate and its truth.

    Attributes
    ----------
    row, seed, run : str, int, int
        What draws the run.
    verdict, reason, plant : str
        ``"failed"`` with the error where there is no answer.
    values, ends, truth : dict
        Of each quantity: value, ends of its interval, ends of the range of the truth.
    half_width : dict
        That of a fit of the right plant to the run without its fault, relative.
    omega, crossover : float
        Crossover of the true plant, and of the estimate.
    size : float
        Size of the fault in the units of its cause; NaN without one.
    causes : list
        Name, size, ends and others, of each cause that the estimate names.
    """

    row: str
    seed: int
    run: int
    verdict: str
    reason: str
    plant: str
    values: dict[str, float]
    ends: dict[str, tuple[float, float]]
    truth: dict[str, tuple[float, float]]
    half_width: dict[str, float]
    omega: float
    crossover: float
    size: float
    causes: list[dict[str, Any]]
    seconds: float

    @property
    def reliable(self) -> bool:
        return self.verdict == "reliable"

    def wrong(self, quantity: str) -> bool:
        """Whether the interval of a reliable answer lies beside the range of the truth."""
        if not self.reliable or quantity not in self.ends:
            return False
        (low, high), (least, most) = self.ends[quantity], self.truth[quantity]
        return high < least or low > most

    def width(self, quantity: str) -> float:
        """Half width of the interval over that of the right plant."""
        low, high = self.ends.get(quantity, (math.nan, math.nan))
        middle = 0.5 * sum(self.truth[quantity])
        return float(0.5 * (high - low) / middle / self.half_width[quantity])

    def as_plain(self) -> dict[str, Any]:
        return asdict(self)


def estimates(row: Row, size: float, seed: int, which: range) -> list[Estimate]:
    """Simulate these runs of a row, and estimate; this runs in other processes."""
    runs = drawn(row.kind, [f"{seed} {row.name} {number}" for number in which])
    sizes = np.full(len(runs), size)
    chain = row.fault.chain(runs, sizes) if row.fault else nothing(runs)
    logs = logged(runs, chain)
    truth = truth_of(runs, logs, row.fault, sizes)
    own = np.full(len(runs), math.nan)
    if row.fault:
        own = named_size(row.fault, chain, sizes, logs.output)
    out = []
    for i, number in enumerate(which):
        ranges = zip(truth.low[i].tolist(), truth.high[i].tolist(), strict=True)
        about: dict[str, Any] = {
            "row": row.name,
            "seed": seed,
            "run": number,
            "truth": dict(zip(QUANTITIES, ranges, strict=True)),
            "half_width": dict(zip(QUANTITIES, truth.half_width[i].tolist(), strict=True)),
            "omega": float(truth.omega[i]),
            "size": float(own[i]),
        }
        out.append(Estimate(**about, **answer(runs, logs, i, float(truth.omega[i]))))
    return out


def recording_of(runs: Runs, logs: Logs, i: int) -> dtm.Recording:
    """What the log holds; without a controller there is no set point."""
    reference: Array | None = None if runs.kind.controller == "open" else logs.reference[i]
    return dtm.Recording(logs.time[i], reference, logs.output[i], logs.command[i])


def known(runs: Runs, i: int) -> dict[str, Any]:
    """What a user knows besides: the controller, that it holds its commands, and the limit."""
    kind, Kp, Ki = runs.kind, float(runs.Kp[i]), float(runs.Ki[i])
    if kind.controller == "open":
        return {}
    found: dict[str, Any] = {"controller": dtm.P(Kp) if kind.controller == "P" else dtm.PI(Kp, Ki)}
    if kind.at[0] == 0.0:
        found["limit"] = kind.limit
    return found | {"between": "held"}


def answer(runs: Runs, logs: Logs, i: int, omega: float) -> dict[str, Any]:
    """The estimate of one run, as fields of `Estimate`."""
    nothing_found: dict[str, Any] = {
        "plant": "",
        "values": {},
        "ends": {},
        "crossover": math.nan,
        "causes": [],
    }
    begin = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about feedback, in every run
            fit = dtm.estimate_delay(recording_of(runs, logs, i), **known(runs, i))
            if fit.verdict != "none":
                nothing_found |= numbers(fit, omega, runs.linear.integrators)
    except (dtm.NotIdentifiableError, dtm.RecordingError) as error:
        about = {"verdict": "none", "reason": str(error)}
    except (dtm.DeadtimeError, ValueError, ArithmeticError) as error:
        about = {"verdict": "failed", "reason": f"{type(error).__name__}: {error}"}
    else:
        about = {"verdict": fit.verdict, "reason": fit.reason}
    return nothing_found | about | {"seconds": time.process_time() - begin}


def numbers(fit: Any, omega: float, integrators: int) -> dict[str, Any]:
    """Values and intervals at the true crossover, and the causes that are named.

    The equivalent delay is that of the angle with the integrators of the true plant, because that
    of a plant which comes to rest would hold their 90 degrees.
    """
    view = fit.at([omega])
    turns = 0.5 * math.pi * integrators
    delay, high, low = (
        -(float(angle) + turns) / omega for angle in (view.phase[0], *view.phase_ci[:, 0])
    )
    values = {"gain": float(view.gain[0]), "delay": delay}
    ends = {"gain": (float(view.gain_ci[0, 0]), float(view.gain_ci[1, 0])), "delay": (low, high)}
    if "largest_gain" in fit.intervals:
        values["largest gain"] = fit.largest_gain
        ends["largest gain"] = fit.ci(name="largest_gain")
    causes = [
        {
            "name": cause.name,
            "size": float(cause.size),
            "ends": tuple(map(float, cause.ci)),
            "others": cause.others,
        }
        for cause in getattr(fit, "causes", ())
    ]
    return {
        "plant": fit.best.name,
        "values": values,
        "ends": ends,
        "crossover": float(fit.crossover),
        "causes": causes,
    }
