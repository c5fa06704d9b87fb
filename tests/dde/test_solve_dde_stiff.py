"""Large and stiff systems of `solve_dde`, against modes in closed form; the limit of steps."""

import deadtime as dtm
import numpy as np
import pytest
import scipy.sparse
from hypothesis import given, strategies as st
from scipy.integrate import solve_ivp


def modes(matrix, source, start, end):
    """y' = A y + a y(t - 1) at the time `end`, a whole number, from a constant history.

    In the basis of the symmetric A each component is e^(rate s) P(s) + q from one multiple of the
    delay to the next, s from its start.
    """
    rate, basis = np.linalg.eigh(matrix)
    value = basis.T @ start
    constant, polynomial = value, np.zeros((1, len(rate)))
    for _ in range(end):
        constant = -source * constant / rate
        powers = np.arange(1, len(polynomial) + 1)
        polynomial = np.vstack([value - constant, source * polynomial / powers[:, None]])
        value = np.exp(rate) * polynomial.sum(axis=0) + constant
    return basis @ value


def heat(n):
    """Second differences on n points with zero at both ends, as a sparse matrix."""
    ones = np.ones(n)
    return (n + 1) ** 2 * scipy.sparse.diags_array(
        [ones[1:], -2.0 * ones, ones[1:]], offsets=[-1, 0, 1], format="csr"
    )


def hump(n):
    x = np.arange(1, n + 1) / (n + 1)
    return 4.0 * x * (1.0 - x)


def run(matrix, start, rtol=1e-6, end=3, vectorized=True, **options):
    return dtm.solve_dde(
        lambda t, y, z: matrix @ y - 3.0 * z[0],
        (0.0, float(end)),
        start,
        1.0,
        rtol=rtol,
        atol=1e-3 * rtol,
        t_eval=[float(end)],
        vectorized=vectorized,
        **options,
    )


@pytest.mark.parametrize("n", [12, 50, 200])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-9])
def test_a_heat_equation_takes_long_elements(n, rtol):
    # Beyond 13 components Newton's matrix had no coupling: 9 s for 50, minutes for 200.
    matrix, start = heat(n), hump(n)
    found = run(matrix, start, rtol)
    assert found.success
    assert np.abs(found.y[:, -1] - modes(matrix.toarray(), -3.0, start, 3)).max() < 20.0 * rtol
    assert found.nfev < 600
    assert found.n_elements < 150


@pytest.mark.parametrize("options", [{"jac_sparsity": heat(60)}, {"vectorized": False}])
def test_a_pattern_given_and_one_found_lead_to_the_same(options):
    start = hump(60)
    given, plain = run(heat(60), start, **options), run(heat(60), start)
    assert given.y == pytest.approx(plain.y, abs=1e-6)
    assert given.nfev < 600


def test_a_pattern_that_lacks_entries_is_noticed():
    # Only the diagonal is declared: Newton's method would fail with it.
    start = hump(60)
    found = run(heat(60), start, jac_sparsity=np.eye(60))
    assert found.y[:, -1] == pytest.approx(modes(heat(60).toarray(), -3.0, start, 3), abs=2e-5)
    assert found.nfev < 600


def test_stiff_systems_with_a_full_jacobian_or_many_components():
    # A full matrix, whose Jacobian waits until sweeps without it fail; 300 components likewise.
    rng = np.random.default_rng(5)
    basis = np.linalg.qr(rng.normal(size=(60, 60)))[0]
    full = basis @ heat(60).toarray() @ basis.T
    start = basis @ hump(60)
    found = run(full, start)
    assert found.y[:, -1] == pytest.approx(modes(full, -3.0, start, 3), abs=2e-5)
    assert found.nfev < 900
    found = run(heat(300), hump(300))
    assert found.y[:, -1] == pytest.approx(modes(heat(300).toarray(), -3.0, hump(300), 3), abs=2e-5)
    assert found.nfev < 900


def test_a_grid_in_two_dimensions():
    one, eye = heat(12), scipy.sparse.eye_array(12)
    matrix = (scipy.sparse.kron(one, eye) + scipy.sparse.kron(eye, one)).tocsr()
    start = np.outer(hump(12), hump(12)).ravel()
    found = run(matrix, start)
    assert found.y[:, -1] == pytest.approx(modes(matrix.toarray(), -3.0, start, 3), abs=2e-5)
    assert found.nfev < 600


@given(st.integers(2, 40), st.integers(0, 2**32), st.floats(0.0, 5.0))
def test_random_sparse_systems(n, seed, stiffness):
    rng = np.random.default_rng(seed)
    entries = rng.normal(size=(n, n)) * (rng.random((n, n)) < 3.0 / n)
    matrix = -(10.0**stiffness) * (entries @ entries.T + 1e-3 * np.eye(n))
    start = rng.normal(size=n)
    found = run(matrix, start)
    assert found.success
    assert np.abs(found.y[:, -1] - modes(matrix, -3.0, start, 3)).max() < 1e-4


def test_a_nonlinear_front_agrees_with_scipy():
    n = 40
    matrix, start = 1e-2 * heat(n), 0.1 * hump(n)

    def fun(t, y, z):
        return matrix @ y + 2.0 * y * (1.0 - z[0])

    found = dtm.solve_dde(fun, (0, 3), start, 1.0, rtol=1e-8, atol=1e-10, vectorized=True)
    past, value = (lambda t: start), start
    for step in range(3):
        piece = solve_ivp(
            lambda t, y, past=past: matrix @ y + 2.0 * y * (1.0 - past(t - 1.0)),
            (step, step + 1),
            value,
            "Radau",
            rtol=1e-10,
            atol=1e-12,
            dense_output=True,
        )
        past, value = piece.sol, piece.y[:, -1]
    # The dense output of Radau is of order 3 only.
    assert found.y[:, -1] == pytest.approx(value, abs=1e-6)
    assert found.nfev < 600


def test_a_large_system_that_is_not_stiff_has_no_jacobian():
    # One of n = 4000 took 19 s and 1.3 GiB.
    n = 1500
    found = dtm.solve_dde(
        lambda t, y, z: -y + np.roll(z[0], 1, axis=0),
        (0, 3),
        np.sin(np.arange(n)),
        1.0,
        vectorized=True,
        t_eval=[3.0],
    )
    one = dtm.solve_dde(
        lambda t, y, z: [-y[0] + z[0, 1], -y[1] + z[0, 2], -y[2] + z[0, 3], -y[3], 0.0 * y[4]],
        (0, 3),
        [np.sin(k) for k in (7, 6, 5, 4, 3)],
        1.0,
        vectorized=True,
        t_eval=[1.0],
    )
    assert found.success
    assert one.success
    assert found.n_nodes < n


# --- the limit of steps ---------------------------------------------------------------------


def sliding(t, y, z):
    return -np.sign(y) + 0.5


def noisy(t, y, z):
    # Too fast for any element: noise to every tolerance asked for here.
    return -z[0] + 1e-4 * np.sin(1e9 * y)


@pytest.mark.parametrize("fun", [sliding, noisy])
def test_runs_that_make_no_progress_end_with_the_reason(fun):
    found = dtm.solve_dde(fun, (0, 20), 1.0, 1.0, vectorized=True, max_steps=3000)
    assert found.status == -1
    assert not found.success
    assert found.n_elements + found.n_rejected <= 3000
    assert "max_steps" in found.message or "short as rounding" in found.message


def test_tolerances_below_the_rounding_of_t_end():
    found = dtm.solve_dde(
        lambda t, y, z: np.cos(300.0 * t) + 0.0 * y,
        (1e9, 1e9 + 50),
        0.0,
        1.0,
        vectorized=True,
        rtol=1e-13,
        atol=1e-13,
        max_steps=2000,
    )
    assert found.status == -1
    assert "raise" in found.message


def test_the_limit_of_steps():
    def limited(**options):
        return dtm.solve_dde(lambda t, y, z: -z[0], (0, 50), 1.0, 1.0, vectorized=True, **options)

    whole = limited()
    tried = whole.n_elements + whole.n_rejected
    assert limited(max_steps=tried).success
    short = limited(max_steps=tried - 1)
    assert short.status == -1
    assert f"max_steps={tried - 1} elements" in short.message
    assert short.t[-1] < 50.0
    assert limited(max_steps=None).success
    with pytest.raises(ValueError, match="max_steps"):
        limited(max_steps=0)
    with pytest.raises(ValueError, match="jac_sparsity has shape"):
        limited(jac_sparsity=np.eye(2))


@pytest.mark.parametrize("n", [9, 40, 600])
def test_components_that_their_past_alone_couples_take_few_calls(n):
    # 600 took 8 sweeps an element, because no Jacobian was taken of so many.
    rng = np.random.default_rng(n)
    rates, past = rng.uniform(1.0, 9.0, n), rng.normal(size=(n, n)) / np.sqrt(n)
    start, history = rng.normal(size=n), rng.normal(size=n)
    found = dtm.solve_dde(
        lambda t, y, z: past @ z[0] - rates[:, None] * y,
        (0.0, 4.0),
        history,
        1.0,
        y0=start,
        rtol=1e-8,
        atol=1e-10,
        t_eval=[0.3, 1.0, 4.0],
        vectorized=True,
    )
    rest = past @ history / rates
    for time, value in zip((0.3, 1.0), found.y.T[:2], strict=True):
        known = rest + (start - rest) * np.exp(-rates * time)
        np.testing.assert_allclose(value, known, rtol=1e-7, atol=1e-9)
    # Two sweeps an element, accepted or not, and one look at the Jacobian.
    assert found.nfev <= 3 * (found.n_elements + found.n_rejected) + 1


def test_elements_longer_than_the_delay_take_no_jacobian_of_a_large_network():
    # Of 500 components the last element, two delays long, once had all 500 columns evaluated.
    n = 500
    rng = np.random.default_rng(1)
    past = scipy.sparse.random_array((n, n), density=5 / n, rng=rng, format="csr")
    widths = []

    def slope(t, y, z):
        widths.append(t.size)
        return np.tanh(0.6 * past @ z[0]) - y

    start = rng.normal(size=n)
    options = {"t_eval": [20.0], "vectorized": True}
    found = dtm.solve_dde(slope, (0.0, 20.0), start, 1.0, **options)
    sharp = dtm.solve_dde(slope, (0.0, 20.0), start, 1.0, rtol=1e-10, atol=1e-12, **options)
    assert max(widths) <= 50
    np.testing.assert_allclose(found.y, sharp.y, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("vectorized", [True, False])
@pytest.mark.parametrize("seed", range(8))
def test_a_coupling_that_a_look_at_the_diagonal_misses_costs_no_accuracy(seed, vectorized):
    # One entry beside the diagonal goes unnoticed in one case of four.
    rng = np.random.default_rng(seed)
    n = 12
    matrix = -np.eye(n)
    row, column = rng.choice(n, 2, replace=False)
    matrix[row, column] = 5.0
    start = rng.normal(size=n)
    found = dtm.solve_dde(
        lambda t, y, z: matrix @ y,
        (0.0, 3.0),
        start,
        1.0,
        rtol=1e-8,
        atol=1e-10,
        t_eval=[3.0],
        vectorized=vectorized,
    )
    known = np.exp(-3.0) * (start + 3.0 * (matrix + np.eye(n)) @ start)
    np.testing.assert_allclose(found.y[:, 0], known, rtol=1e-7, atol=1e-9)
