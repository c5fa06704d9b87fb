"""Gains that follow the delay, from a list that is proved stable for all its changes.

`_claims` is the mathematics and the proof as data, `_check` verifies it in exact arithmetic
(`_enclosed`) and `_proof` stores it. `_switched` and `_search` find a form, `_given` and
`_schedule` put a schedule together, and `_follow` chooses from it during a run.
"""

from deadtime.tuning.adaptive._follow import Choice, GainFollower
from deadtime.tuning.adaptive._proof import SwitchingProof
from deadtime.tuning.adaptive._schedule import GainSchedule, GainSet, adaptive_gains

__all__ = ["Choice", "GainFollower", "GainSchedule", "GainSet", "SwitchingProof", "adaptive_gains"]
