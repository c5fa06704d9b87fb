r"""What a proof of a gain schedule claims, as data.

The plant is g (b1 s + b0) / (s (a2 s + a1)), the gain g anywhere in an interval, with the state x.
Every Ts a controller P or PV measures, and its filter, where there is one, moves on samples. With
set i it sends the command u = -f_i Kp z, z = y + (Kv/Kp) y' from the reference on, f_i a factor.

The delay may change. During a sample the vehicle obeys commands of age p, which are those of p
samples ago. If a set is in use only while the delay d of its commands is in its interval
[m_i Ts, M_i Ts], then m_i <= p <= M_i: with the delay constant, two neighbouring ages in turn, with
a changing one any. With the limit L, the command is f Kp z with f from f_least to f_i as long as
abs(f_least Kp z) <= L. So x and the past z follow

    x(k+1) = Phi x(k) - g Kp sum_j gamma_j f_j z(k - p_j),   z(k) = c x(k),

with one term for a plant without a lag, gamma_1 = B Ts, in any order of the commands. With a lag
the state G(t) after a time t of unit command is a convex curve in the plane. It lies in the
triangle of its ends and of the point Q where its end tangents meet, and its coordinates in the
triangle are monotone along it. So gamma_1 = Q and gamma_2 = G(Ts) - Q, where the command of
gamma_1 is never older than that of gamma_2, if commands are obeyed in the order in which they were
given.

The set of matrices A is the convex hull of those with f at the ends of its range and each
p_j an age: A'PA < P is convex in A, so it holds for all if it holds for these. Then v'Pv decreases
whatever the delay, the set and the limit do from sample to sample, and P bounds z: from v'Pv <= 1,
which contains a step of the reference from rest of `step`, abs(f_least Kp z) never exceeds L.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

#: Corner in rad/s, damping, and the rule by which it runs on samples.
FilterNumbers: TypeAlias = tuple[float, float, Literal["tustin", "backward"]]


@dataclass(frozen=True)
class Claims:
    """The claims of a `SwitchingProof`, where the fields are described."""

    num: tuple[float, ...]
    den: tuple[float, ...]
    gain: tuple[float, float]
    sample_time: float
    Kp: float
    Kv: float
    filter: FilterNumbers | None
    factors: tuple[float, ...]
    ages: tuple[tuple[int, int], ...]
    limit: float | None
    least_factor: float
    decay: float
    step: float
    form: tuple[tuple[float, ...], ...]
