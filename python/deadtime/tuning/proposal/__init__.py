"""From a recording to gains that can be typed in."""

from deadtime.tuning.proposal._prediction import Prediction
from deadtime.tuning.proposal._proposal import Proposal
from deadtime.tuning.proposal._tune import tune

__all__ = ["Prediction", "Proposal", "tune"]
