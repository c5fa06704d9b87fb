"""`choose_plant`: how many lags a plant has, and whether they are complex, by the evidence.

Each plant of the family is fitted with all its numbers free, beside the noise. Schwarz's (1978)
criterion weighs the likelihood against the number of unknowns,

    BIC = -2 ln L + k ln n,

k the numbers of the plant, of its trim and of coloured sensor noise, n the rows (air is fitted
beside every plant). The plant of the least BIC is taken among those whose
model is reliable, or among all where none is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

from deadtime._base.digits import between
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.verdicts import Verdict
from deadtime.estimation._estimate import estimate_delay, method_of
from deadtime.estimation._native import mixture_interval
from deadtime.estimation._result import DelayEstimate, bic
from deadtime.estimation.methods._method import Loops, Method, Recordings, Windows, paired_runs
from deadtime.estimation.methods._output_error import OutputError
from deadtime.estimation.methods._waveform import Waveform
from deadtime.loops import ControlLoop, FactoredPlant

#: Most lags that are tried.
MOST_LAGS = 3

#: Where the first lag and each further one begin, in rows, and the zero, as shares of the lags.
LONG, SHORT, ZEROS = 3.0, 0.5, (0.3, 3.0)

#: Two lags that come out within this factor may be a pair of complex poles, which real ones come
#: closest to where they are equal; the damping from which that pair is searched.
ALIKE, DAMPING = 0.7, 0.7

#: Headings of the table.
PLANT_COLUMNS = ("plant", "BIC", "white", "verdict", "delay", "lag", "sum", "95 % interval")

#: The part of its range to which an interval of delay and lag together is found, and the least
#: weight of a plant in it.
PLACES, LEAST = 4e6, 1e-3


@dataclass(frozen=True, eq=False, repr=False)
class PlantChoice(ReadOnlyArrays):
    """Plants of a family fitted to the same recordings, and the one that the evidence is for.

    Attributes
    ----------
    estimates : dict of str to DelayEstimate
        By the name of the plant, such as ``"2 lags, zero"``.
    criteria : dict of str to float
        Their BIC; the likeliest plant has the least.
    refusals : dict of str to str
        The reasons of plants that gave no estimate.
    chosen : str
        Name of the plant that was taken.
    """

    estimates: Mapping[str, DelayEstimate]
    criteria: Mapping[str, float]
    refusals: Mapping[str, str]
    chosen: str

    @property
    def best(self) -> DelayEstimate:
        """The estimate with the plant that was taken."""
        return self.estimates[self.chosen]

    @property
    def verdict(self) -> Verdict:
        """That on the plant that was taken: ``"reliable"`` or ``"indication"``."""
        return self.best.verdict

    def headline(self) -> str:
        """The verdict, and the delay with the plant that was taken."""
        return f"{self.best.headline()}; {self.chosen}"

    @property
    def weights(self) -> dict[str, float]:
        """Probability of each plant that may be taken, if all were as probable before."""
        likely = {name: self.criteria[name] for name in _reliable(self.estimates)}
        least = min(likely.values())
        shares = {name: math.exp(0.5 * (least - criterion)) for name, criterion in likely.items()}
        return {name: share / sum(shares.values()) for name, share in shares.items()}

    def ci(self, level: float = 0.95) -> tuple[float, float]:
        """Interval of delay and lag together, s, over all plants that may be taken.

        A plant with fewer lags than the vehicle may be the likeliest, and its own interval does not
        know of the others. This is that of their mixture by `weights` (Hoeting et al. 1999).

        Parameters
        ----------
        level : float
            Between 0 and 1.
        """
        from scipy import special

        one_sigma = float(special.erf(math.sqrt(0.5)))
        weights = {name: weight for name, weight in self.weights.items() if weight > LEAST}
        fits = {name: self.estimates[name] for name in weights}
        ends = [fit.ci(level, "delay+lag") for fit in fits.values()]
        low, high = min(low for low, _ in ends), max(high for _, high in ends)
        parts = [
            (weight / sum(weights.values()), fit.delay_plus_lag, *fit.ci(one_sigma, "delay+lag"))
            for weight, fit in zip(weights.values(), fits.values(), strict=True)
        ]
        return mixture_interval(parts, level, (low, high), (high - low) / PLACES)

    def rows(self) -> list[list[str]]:
        """The plants as cells of a table with the headings `PLANT_COLUMNS`, the likeliest first."""
        least = min(self.criteria.values())
        found = []
        for name in sorted(self.criteria, key=lambda name: self.criteria[name]):
            fit = self.estimates[name]
            ends = "not reliable"
            if fit.verdict == "reliable":
                low, high = fit.ci(0.95, "delay+lag")
                span = fit.recording.time[-1] - fit.recording.time[0]
                ends = f"{low:.3f} – {high:.3f}" if high - low < span else "unknown"
            found.append(
                [
                    f"{name} *" if name == self.chosen else name,
                    f"{self.criteria[name] - least:+.1f}",
                    "yes" if fit.whiteness.white else "no",
                    fit.verdict,
                    f"{fit.delay:.3f}",
                    f"{fit.lag or 0.0:.3f}",
                    f"{fit.delay_plus_lag:.3f}",
                    ends,
                ]
            )
        return found + [[name, f"refused: {why}"] for name, why in self.refusals.items()]

    def remarks(self) -> list[str]:
        """What the table means, in sentences."""
        found = "None of the plants that were tried gives a reliable estimate."
        if self.best.verdict == "reliable":
            found = (
                "Sum of delay and lag, averaged over all plants by their "
                f"probabilities: {between(*self.ci(), math.nan, 's')} (95 %)."
            )
        return ["BIC is less that of the likeliest plant; * was taken; times in s.", found]

    def to_dict(self) -> dict[str, Any]:
        """All results but the arrays, as plain values for JSON."""
        return {
            "verdict": self.verdict,
            "chosen": self.chosen,
            "delay_plus_lag_interval_95": list(self.ci()),
            "bic": dict(self.criteria),
            "estimates": {name: fit.to_dict() for name, fit in self.estimates.items()},
            "refusals": dict(self.refusals),
        }

    def __repr__(self) -> str:
        return f"<PlantChoice {self.chosen} of {len(self.estimates)} plants: {self.best!r}>"

    def __str__(self) -> str:
        rows = [list(PLANT_COLUMNS), *self.rows()]
        full = [row for row in rows if len(row) == len(PLANT_COLUMNS)]
        widths = [max(len(cell) for cell in column) for column in zip(*full, strict=True)]
        lines = [
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=False)).rstrip()
            for row in rows
        ]
        return "\n".join([self.headline(), *lines, *self.remarks(), "", self.best.summary()])


def choose_plant(
    recording: Recordings,
    loop: Loops,
    *,
    method: str | Method = "auto",
    window: Windows = None,
    most_lags: int = MOST_LAGS,
) -> PlantChoice:
    """Estimate the delay with as many lags as the recording shows.

    Plants with none to `most_lags` lags, each with and without a zero, are fitted with all their
    numbers free; where the two longest lags come out alike, also with a pair of complex poles in
    their place. Whether the plant integrates is known from that of `loop`. Which of two plants it
    is may be open, and how the lags divide among themselves: delay and lag together are well
    determined in any case.

    Parameters
    ----------
    recording : Recording or list of Recording
        As for `deadtime.estimate_delay`.
    loop : ControlLoop or list of ControlLoop
        What is known. The plant says whether it integrates, and its gain is a start.
    method : str or Method
        ``"output_error"`` or ``"waveform"``; ``"auto"`` takes the first where all recordings have
        a command.
    window : (low, high) or list of them, optional
        The part to use, s.
    most_lags : int
        Up to how many lags are tried.

    Returns
    -------
    PlantChoice

    Raises
    ------
    NotIdentifiableError
        When no plant of the family gives an estimate; the message has the reason of the first.
    ValueError
        If a plant has delays inside, or `most_lags` is below one.

    References
    ----------
    G. Schwarz, "Estimating the dimension of a model", Annals of Statistics 6 (1978).

    Examples
    --------
    A vehicle with two lags follows a square wave:

    >>> import numpy as np
    >>> import deadtime as dtm
    >>> time = np.arange(200) * 0.02
    >>> command = np.where(time < 0.3, 0.0, 0.2 * np.sign(np.sin(3.7 * (time - 0.3))))
    >>> vehicle = dtm.FactoredPlant([0.15, 0.05]).transfer_function() * dtm.delay(0.047)
    >>> attitude = np.ravel(vehicle.simulate(time, command).outputs)
    >>> attitude = attitude + 0.003 * np.random.default_rng(1).standard_normal(200)
    >>> flight = dtm.Recording(time, command, attitude, command=command)
    >>> known = dtm.ControlLoop(dtm.FirstOrder(), dtm.P(1.0), sample_time=0.02)
    >>> choice = dtm.estimation.choose_plant(flight, known, most_lags=2)
    >>> choice.chosen
    '2 lags'
    >>> low, high = choice.best.ci(0.95, "delay+lag")
    >>> low < 0.247 < high
    True
    """
    if most_lags < 1:
        raise ValueError(f"most_lags={most_lags}: give 1 or more")
    runs = paired_runs(recording, loop, window)
    # The plants of this family are the rivals of one another.
    chosen = method_of(method, (run.recording for run in runs))
    if isinstance(chosen, (OutputError, Waveform)):
        chosen = replace(chosen, rivals=False)
    loops = [run.loop for run in runs]
    if not all(control_loop.plant.is_rational for control_loop in loops):
        raise ValueError(
            "the plant has delays inside, but choose_plant fits a gain, "
            "lags and a zero, all behind one delay. Give an Integrator() "
            "or a FirstOrder() to say whether the plant integrates"
        )
    estimates: dict[str, DelayEstimate] = {}
    refusals = {}

    def tried(name: str, plant: FactoredPlant) -> FactoredPlant | None:
        """Fit the plant without and with a zero; the fitted one without."""
        best, size = None, plant.lag
        # At a zero of none its effect would be that of the delay, so that a search stays there.
        for shares in ((0.0,), ZEROS) if size else ((0.0,),):
            with_zero = shares is ZEROS
            label = f"{name}{', zero' * with_zero}"
            free = ["delay", *(key for key in plant.parameters if with_zero or key != "zero")]
            options: dict[str, Any] = {"method": chosen, "free": free, "window": window}
            fits = []
            for share in shares:
                started = replace(plant, zero=share * size)
                known = [control_loop.replace(plant=started) for control_loop in loops]
                try:
                    fits.append(estimate_delay(recording, known, **options))
                except NotIdentifiableError as error:
                    refusals[label] = str(error)
            if fits:
                refusals.pop(label, None)
                estimates[label] = fit = min(fits, key=bic)
                best = best or cast(FactoredPlant, fit.loop.plant)
        return best

    plant = _first(loops[0], runs[0].recording.sample_time)
    for count in range(len(plant.lags), most_lags + 1):
        if count > len(plant.lags):
            further = SHORT * runs[0].recording.sample_time
            plant = replace(plant, lags=(*plant.lags, further), zero=0.0)
        if found := tried(_lags(count), plant):
            plant = found  # where the search of the next plants begins
        if (paired := with_pair(plant)) is not None:
            rest = len(paired.lags)
            tried(f"a pair, {_lags(rest)}" if rest else "a pair", paired)
    if not estimates:
        raise NotIdentifiableError(next(iter(refusals.values())))
    criteria = {name: bic(fit) for name, fit in estimates.items()}
    return PlantChoice(estimates, criteria, refusals, likeliest(estimates))


def with_pair(plant: FactoredPlant) -> FactoredPlant | None:
    """The plant with complex poles for its two longest lags; None where those are not alike."""
    ordered = sorted(plant.lags, reverse=True)
    first, second = (*ordered, 0.0, 0.0)[:2]
    if plant.has_pair or not second > ALIKE * first > 0.0:
        return None
    frequency = 2.0 * DAMPING / (first + second)
    return replace(
        plant, lags=ordered[2:], pole_frequency=frequency, pole_damping=DAMPING, zero=0.0
    )


def likeliest(estimates: Mapping[str, DelayEstimate]) -> str:
    """Name of the likeliest plant among the reliable ones, or among all where none is."""
    return min(_reliable(estimates), key=lambda name: bic(estimates[name]))


def _lags(count: int) -> str:
    return f"{count or 'no'} {'lag' if count == 1 else 'lags'}"


def _reliable(estimates: Mapping[str, DelayEstimate]) -> list[str]:
    """Names of the reliable ones, or of all where none is."""
    return [name for name, fit in estimates.items() if fit.verdict == "reliable"] or list(estimates)


def _first(loop: ControlLoop, sample: float) -> FactoredPlant:
    """The plant of the family with the fewest lags."""
    _, den = loop.plant.polynomials()
    integrator = bool(den[-1] == 0.0)
    lags = () if integrator else (LONG * sample,)
    return FactoredPlant(lags, loop.parameters.get("gain", 1.0), integrator=integrator)
