"""What the tests of a fit say, in words."""

from __future__ import annotations

import math
from dataclasses import dataclass

from deadtime._base.digits import stated
from deadtime.estimation._least_squares import Whiteness
from deadtime.estimation._native import FlightFinding, FlightProfile

#: What speaks against a fit, by the kernel's name of it, with its sizes.
WORDS = {
    "colour": (
        "the residuals are not white even after the "
        "noise was fitted (lag-1 autocorrelation {0:.2f})"
    ),
    "lag": "with a further lag of {0:.3g} s the recording is more likely, so the plant lacks a lag",
    "lag moves": (
        "with a further lag of {0:.3g} s, the sum of delay and "
        "lag would be {1:.3g} s, which is outside its interval"
    ),
    "overshoot": (
        "with a further lag of {0:.3g} s and a zero of {1:.3g} "
        "s the recording is more likely, so the plant lacks both"
    ),
    "below zero": (
        "the likelihood still rises as the delay falls to "
        "zero, so the plant has too much lag, or lacks a zero"
    ),
    "change": (
        "the delay is not constant over the window{where}: its standard deviation is {time}"
    ),
    "speed": (
        "the noise grows with the speed of the output{where}, so "
        "the time stamps are probably not the times of the samples"
    ),
    "restless air": (
        "the fitted disturbance{where} is too large to be wind. Within a row it changes "
        "by {0:.2g} times the sensor noise, so the plant probably lacks a lag or a zero"
    ),
    "moving air": (
        "the fitted disturbance{where} is larger while the vehicle "
        "moves than at rest, so the plant probably lacks a lag or a zero"
    ),
    "gains": "the recordings contradict one another in {name}: {values}",
    "totals": "the recordings contradict one another in {name}: {times}",
}


@dataclass(frozen=True)
class Adequacy:
    """What the tests say.

    Attributes
    ----------
    whiteness : Whiteness
        Of the whitened residuals.
    reasons : tuple of str
        Why the model does not hold; empty where it is.
    plant_lacks : bool
        Whether one of them is that the plant lacks something: a lag, or what the air stands for.
    coloured : bool
        Whether the whitened residuals have a colour that is there while the vehicle rests, too:
        then the intervals have to be made valid for it.
    """

    whiteness: Whiteness
    reasons: tuple[str, ...]
    plant_lacks: bool = False
    coloured: bool = False


def adequacy_of(profile: FlightProfile) -> Adequacy:
    """Test a fit."""
    found = profile.judge()
    against = [finding for finding in found.findings if finding.is_against]
    return Adequacy(
        Whiteness(*found.whiteness),
        tuple(_in_words(finding, profile) for finding in against),
        any(finding.plant_lacks for finding in against),
        found.is_coloured,
    )


def unseen_in_words(lag: float) -> str:
    """The further lag that would not be seen, up to the verb."""
    if math.isinf(lag):
        return "no further lag would"
    return f"a further lag below {lag:.2g} s would not"


def _in_words(found: FlightFinding, profile: FlightProfile) -> str:
    several = found.run is not None and len(profile.fit.numbers.noise) > 1
    pairs = list(zip(found.sizes[::2], found.sizes[1::2], strict=False))
    total = next((name for name in dict(profile.stderr) if name.startswith("delay+")), "")
    return WORDS[found.cause].format(
        *found.sizes,
        where=f" in recording {found.run + 1}" if several and found.run is not None else "",
        time=stated(found.sizes[0], math.nan, "s") if found.cause == "change" else "",
        name="gain" if found.cause == "gains" else total,
        values=", ".join(stated(value, error, "") for value, error in pairs),
        times=", ".join(stated(value, error, "s") for value, error in pairs),
    )
