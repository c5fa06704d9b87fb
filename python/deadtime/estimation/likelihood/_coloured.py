"""Intervals for whitened residuals with a colour that is there while the vehicle rests, too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from deadtime.estimation._native import FlightProfile, colour_factors
from deadtime.estimation.likelihood._profile import LikelihoodProfile


@dataclass(frozen=True, eq=False)
class ColouredProfile(LikelihoodProfile):
    """The profile for residuals of this colour: `colour` are factors on the variances."""

    colour: Mapping[str, float] = field(default_factory=dict)

    def _native(self) -> FlightProfile:
        return super()._native().widened([self.colour[name] for name in self.names])


def coloured_profile(profile: LikelihoodProfile) -> ColouredProfile:
    """The same fit with intervals for the colour of its whitened residuals."""
    colour = dict(zip(profile.names, colour_factors(profile.native), strict=True))
    return ColouredProfile(profile.fit, profile.names, profile.preferred, colour=colour)
