"""One root that is proved to lie in the right half plane proves that an equation is unstable."""

import numpy as np
import pytest
from deadtime import DelaySystem, QuasiPolynomial, delay, s

UNSTABLE = [
    s * (1 + 0.5 * delay(1.0)) + 1e8 * delay(1.0),
    s + 27.0 + (126037496.6 - 0.418 * s) * delay(4.62) + (55451.0 - 0.188 * s) * delay(4.622),
]


@pytest.mark.parametrize("h", UNSTABLE)
@pytest.mark.parametrize("strong", [True, False])
def test_one_root_in_the_right_half_plane_proves_instability(h, strong):
    # The axis was walked for seconds up to |Im s| = 1e8, or the answer refused.
    assert not h.is_stable(strong)
    assert h.roots(re=(1e-3, 40.0), im=(0, 10.0), edge="inside").counted > 0


def test_one_unstable_root_of_a_system_of_matrices_proves_instability():
    rng = np.random.default_rng(0)
    n = 12
    late = -1e6 * np.eye(n) + rng.normal(size=(n, n))
    system = DelaySystem({0.0: -np.eye(n), 1.0: late}, N={1.0: np.eye(n) / 3.0})
    assert not system.is_stable()


@pytest.mark.parametrize("seed", range(15))
def test_stability_agrees_with_counting_over_eight_decades(seed):
    rng = np.random.default_rng(seed)
    n, m = rng.integers(1, 4, size=2)
    rows = 10.0 ** rng.uniform(-4, 4, size=(m + 1, n + 1))
    rows[0, n], rows[1:, n] = 1.0, 0.0
    h = QuasiPolynomial(rows, np.append(0.0, np.cumsum(10.0 ** rng.uniform(-3, 1, m))))
    assert h.is_stable() == (h.count(re=(0, None)) == 0)
