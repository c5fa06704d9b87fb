"""Random processes at sample times: air through a plant, coloured noise of a sensor.

x' = A x + w, y = C x, with white w of intensity W. Over a step h the state moves on by

    x(t + h) = Phi x(t) + e,  Phi = e^(A h),  cov e = Q = ∫ e^(A s) W e^(A' s) ds over 0 to h,

which is drawn as it is, without steps in between. Both follow from the block exponential of
Van Loan (1978) over a step h / 2^k with ‖A‖ h / 2^k below 1/2, and from k doublings, Phi(2h) =
Phi(h)² and Q(2h) = Q(h) + Phi(h) Q(h) Phi(h)': over the whole of a long step, the exponential would
lose the digits of states that decay fast.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime.loops import Plant, realise

#: Steps that differ by less than this share of the median are the same.
SAME_STEP = 1e-9

#: Largest growth of a free motion of the plant over the run, as a power of e: the effect of the
#: air would lose half of its digits against the command that holds it.
MOST_GROWTH = 18.0


class RandomProcess(NamedTuple):
    """A linear random process.

    Attributes
    ----------
    A : ndarray, shape (m, m)
    intensity : ndarray, shape (m,)
        Diagonal of the intensity W of the white noise.
    C : ndarray, shape (m,)
    mean, variance : ndarray, shape (m,)
        Of the states at the first sample, where they are independent.
    """

    A: Array
    intensity: Array
    C: Array
    mean: Array
    variance: Array

    @classmethod
    def of_sensor(cls, deviation: float, time_constant: float) -> RandomProcess:
        """A stationary Ornstein-Uhlenbeck process."""
        variance = np.array([deviation**2])
        return cls(
            np.array([[-1.0 / time_constant]]),
            2.0 * variance / time_constant,
            np.ones(1),
            np.zeros(1),
            variance,
        )

    @classmethod
    def of_air(
        cls, plant: Plant, deviation: float, time_constant: float, walk: float, trim: float
    ) -> RandomProcess:
        """A plant of unit gain under gusts, and under air that walks from the trim on.

        The states are those of the plant, which is at rest at the first sample, then the gusts,
        then the walk.
        """
        space = realise(*plant._polynomials({**plant.parameters, "gain": 1.0}))
        n = len(space.B)
        A = np.zeros((n + 2, n + 2))
        A[:n, :n] = space.A
        A[:n, n:] = space.B[:, None]
        A[n, n] = -1.0 / time_constant
        intensity, mean, variance = np.zeros((3, n + 2))
        intensity[n:] = 2.0 * deviation**2 / time_constant, walk**2
        mean[-1] = trim
        variance[n] = deviation**2
        return cls(A, intensity, np.r_[space.C, space.D, space.D], mean, variance)

    def drawn(self, time: Array, generator: np.random.Generator) -> Array:
        """One course of the process at these times."""
        self._check_growth(time)
        state = self.mean + np.sqrt(self.variance) * generator.standard_normal(self.mean.size)
        found = [float(self.C @ state)]
        for Phi, _, root in self._steps(time):
            state = Phi @ state + root @ generator.standard_normal(state.size)
            found.append(float(self.C @ state))
        return np.array(found)

    def covariance(self, time: Array) -> Array:
        """Covariance of the process at these times, shape (n, n)."""
        self._check_growth(time)
        n = time.size
        P = np.diag(self.variance)
        # Covariance of the present state with the outputs so far, a row an output.
        past = np.empty((n, self.mean.size))
        found = np.empty((n, n))
        past[0] = P @ self.C
        found[0, 0] = self.C @ past[0]
        for i, (Phi, Q, _) in enumerate(self._steps(time), start=1):
            P = Phi @ P @ Phi.T + Q
            past[:i] = past[:i] @ Phi.T
            past[i] = P @ self.C
            found[i, : i + 1] = found[: i + 1, i] = past[: i + 1] @ self.C
        return found

    def _steps(self, time: Array) -> Iterator[tuple[Array, Array, Array]]:
        """Phi, Q and a root of Q from each time to the next."""
        steps = np.diff(time)
        grid = SAME_STEP * float(np.median(steps))
        known: dict[int, tuple[Array, Array, Array]] = {}
        for step in steps:
            key = round(step / grid)
            if key not in known:
                Phi, Q = self._moved_on(float(step))
                values, vectors = np.linalg.eigh(Q)
                known[key] = Phi, Q, vectors * np.sqrt(np.maximum(values, 0.0))
            yield known[key]

    def _moved_on(self, step: float) -> tuple[Array, Array]:
        """Phi and Q of one step."""
        from scipy import linalg

        n = self.mean.size
        doublings = max(0, int(np.ceil(np.log2(2.0 * np.linalg.norm(self.A, 1) * step + 1e-300))))
        block = np.zeros((2 * n, 2 * n))
        block[:n, :n] = -self.A
        block[:n, n:] = np.diag(self.intensity)
        block[n:, n:] = self.A.T
        both = linalg.expm(block * (step / 2**doublings))
        Phi = both[n:, n:].T
        Q = Phi @ both[:n, n:]
        for _ in range(doublings):
            Q = Q + Phi @ Q @ Phi.T
            Phi = Phi @ Phi
        return Phi, 0.5 * (Q + Q.T)

    def _check_growth(self, time: Array) -> None:
        growth = float(np.max(np.linalg.eigvals(self.A).real)) * float(time[-1] - time[0])
        if growth > MOST_GROWTH:
            raise ValueError(
                f"the plant is unstable and grows by e^{growth:.3g} over the run, so rounding "
                "errors hide the effect of wind (air): give a shorter experiment"
            )
