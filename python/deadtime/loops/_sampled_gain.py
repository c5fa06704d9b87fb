"""A sampled loop cut at its command.

Between samples the state of the plant follows from matrix exponentials, and the command u_k arrives
m samples and a fraction of one later. With the state x_k of plant, controller and the command that
is held within this fraction,

    x_{k+1} = T x_k + b v_k,   u_k = c x_k,   L(z) = -z^(-m) c (z I - T)^(-1) b:

if the loop is closed by v = u, its poles are the zeros of 1 + L (Åström and Wittenmark,
Computer-Controlled Systems, 3rd ed. 1997, section 2.3, for the fractional delay).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime.loops._model import LoopModel


class SampledLoopGain(NamedTuple):
    """T, b and c of a loop, in its own units, and the whole samples of delay."""

    T: Array
    b: Array
    c: Array
    whole: int

    @classmethod
    def of(cls, model: LoopModel, delay: float, sample_time: float) -> SampledLoopGain:
        """Cut the loop of `model` at its command."""
        whole = math.floor(delay / sample_time)
        part = max(delay - whole * sample_time, 0.0)
        # With a sample more of delay the newest command is a state beside the oldest one.
        closed = model.native(part + sample_time, sample_time).transition_matrix()
        n = len(model.B)
        kept = [*range(n), n + 1]
        T = closed[np.ix_(kept, kept)]
        T[n] = 0.0
        return cls(T, np.append(closed[:n, n], 1.0), closed[n, kept], whole)
