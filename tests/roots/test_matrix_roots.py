"""Roots of det M without its expansion, against independent results."""

import itertools
import math
import signal
import threading

import deadtime as dtm
import flint
import mpmath as mp
import numpy as np
import pytest
from deadtime import DelaySystem
from deadtime.roots._matrix_roots import MatrixDeterminant
from hypothesis import given, settings, strategies as st


def matrix_of(system):
    return MatrixDeterminant(system.E, system.N, system.A)


def random_system(seed, n, neutral=False):
    rng = np.random.default_rng(seed)
    late = {0.75: 0.3 * rng.normal(size=(n, n)) / math.sqrt(n)} if neutral else None
    return DelaySystem(
        {0.0: rng.normal(size=(n, n)) - 2 * np.eye(n), 0.3: rng.normal(size=(n, n))}, N=late
    )


def unimodular(rng, n):
    """An integer matrix and its inverse, exactly."""
    lower = np.tril(rng.integers(-1, 2, size=(n, n)), -1) * (rng.random((n, n)) < 3 / n)
    lower = lower + np.eye(n)
    inverse = np.rint(np.linalg.inv(lower))
    assert (lower @ inverse == np.eye(n)).all()
    return lower, inverse


def assert_holds(found, wanted, room=0.0):
    """Every disc contains as many expected roots as it claims; each of them is in a disc."""
    wanted = list(wanted)
    assert found.counted == len(wanted)
    left = np.ones(len(wanted), bool)
    places = np.array(wanted)
    for root, radius, number in zip(found.roots, found.radii, found.multiplicities, strict=True):
        near = left & (abs(places - root) <= radius + room)
        assert near.sum() == number, (root, radius, number)
        left &= ~near
    assert not left.any()


# The expanded determinant


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("neutral", [False, True])
def test_small_systems_have_the_roots_of_their_expansion(n, neutral):
    system = random_system(n, n, neutral)
    h, matrix = system.characteristic(), matrix_of(system)
    for re, im in [((-6, 5), (-20, 20)), ((-2, 5), (0.5, 60)), ((-4, 3), (0, 15))]:
        assert matrix.count(re, im) == h.count(re, im)
        found, wanted = matrix.roots(re, im), h.roots(re, im)
        assert found.counted == wanted.counted
        for root, radius in zip(found.roots, found.radii, strict=True):
            # The coefficients of the expansion are rounded, which moves its roots.
            assert abs(wanted.roots - root).min() <= radius + 1e-9
            assert radius < 1e-8
    if not neutral:
        assert matrix.count((0, None)) == h.count((0, None))
        assert matrix.rightmost(2).roots[0] == pytest.approx(h.rightmost(2).roots[0], abs=1e-9)
        assert matrix.spectral_abscissa() == pytest.approx(h.spectral_abscissa(), abs=1e-9)
        assert matrix.is_stable() == h.is_stable()


# Many states, with roots known otherwise


@pytest.mark.parametrize("n", [12, pytest.param(40, marks=[pytest.mark.survey, pytest.mark.long])])
def test_without_delay_roots_are_eigenvalues(n):
    rng = np.random.default_rng(n)
    A = np.rint(8 * rng.normal(size=(n, n)))
    with mp.workdps(40):
        wanted = [complex(z) for z in mp.eig(mp.matrix(A.tolist()), left=False, right=False)]
    system = DelaySystem(A)
    size = 2.0 * max(map(abs, wanted))
    assert_holds(system.poles(re=(-size, size), im=(-size, size)), wanted, room=1e-14 * size)
    assert system.count() == n
    assert system.count(re=(0, None)) == sum(z.real > 0 for z in wanted)
    assert system.spectral_abscissa() == pytest.approx(max(z.real for z in wanted), rel=1e-10)


@pytest.mark.parametrize("n", [12, 20, pytest.param(30, marks=pytest.mark.survey)])
def test_similar_scalar_equations(n):
    # x' = a x + b x(t - 1) has the roots a + W_k(b e^-a).
    rng = np.random.default_rng(n)
    a, b = rng.integers(-8, 9, size=n) / 4, rng.integers(1, 12, size=n) / 4 * rng.choice([-1, 1], n)
    there, back = unimodular(rng, n)
    system = DelaySystem({0.0: there @ np.diag(a) @ back, 1.0: there @ np.diag(b) @ back})
    re, im = (-1.9, 4.0), (-15.1, 15.1)
    with mp.workdps(40):
        wanted = [
            complex(x + mp.lambertw(y * mp.exp(-x), k))
            for x, y in zip(map(mp.mpf, a.tolist()), map(mp.mpf, b.tolist()), strict=True)
            for k in range(-6, 7)
        ]
    wanted = [z for z in wanted if re[0] < z.real < re[1] and im[0] < z.imag < im[1]]
    assert system.count(re, im) == len(wanted)
    assert_holds(system.poles(re, im), wanted, room=1e-14)
    assert system.spectral_abscissa() == pytest.approx(max(z.real for z in wanted), abs=1e-10)


@pytest.mark.parametrize("n", [20, pytest.param(30, marks=pytest.mark.survey)])
def test_a_ring_of_cars_has_the_roots_of_its_modes(n):
    # Each driver reacts to the gap ahead 0.6 s late: the Fourier transform parts the ring into
    # s^2 + c s + k (1 - z) e^(-0.6 s), z an n-th root of one.
    c, k, tau = 0.9, 0.3, 0.6
    one, zero = np.eye(n), np.zeros((n, n))
    ahead = np.roll(one, 1, axis=1)
    system = DelaySystem(
        {
            0.0: np.block([[zero, one], [zero, -c * one]]),
            tau: np.block([[zero, zero], [k * (ahead - one), zero]]),
        }
    )
    re, im = (-1.3, 1.0), (0.01, 8.0)
    found = system.poles(re, im)
    # z = 1 gives s (s + c), of which neither root is in the region.
    z = np.exp(2j * np.pi * np.arange(n) / n)
    s = found.roots
    residual = s[:, None] ** 2 + c * s[:, None] + k * (1 - z) * np.exp(-tau * s[:, None])
    slope = 2 * s[:, None] + c - tau * k * (1 - z) * np.exp(-tau * s[:, None])
    assert (abs(residual / slope).min(axis=1) <= found.radii + 1e-13).all()
    assert found.counted == sum(modes_in(w, (c, k, tau), re, im) for w in z)


def modes_in(z, numbers, re, im):
    """Roots of s^2 + c s + k (1 - z) e^(-tau s) in a rectangle: sums of small enough angles."""
    c, k, tau = numbers
    corners = [complex(re[0], im[0]), complex(re[1], im[0]), complex(re[1], im[1])]
    corners += [complex(re[0], im[1]), corners[0]]
    turns = 0.0
    for a, b in itertools.pairwise(corners):
        s = a + (b - a) * np.linspace(0, 1, 4001)
        h = s**2 + c * s + k * (1 - z) * np.exp(-tau * s)
        steps = np.angle(h[1:] / h[:-1])
        assert abs(steps).max() < 0.5
        turns += steps.sum()
    return round(turns / (2 * np.pi))


def ball_winding(system, re, im, steps=600):
    """Winding number of det M with ball arithmetic at points so close that angles are small."""
    corners = [(re[0], im[0]), (re[1], im[0]), (re[1], im[1]), (re[0], im[1]), (re[0], im[0])]
    points = []
    for (a, b), (x, y) in itertools.pairwise(corners):
        share = np.arange(steps) / steps
        points += list(zip(a + (x - a) * share, b + (y - b) * share, strict=True))
    values = []
    for x, y in points:
        s = flint.acb(float(x), float(y))
        total = flint.acb_mat((system.E + 0.0).tolist()) * s
        for tau, matrix in system.A.items():
            total -= flint.acb_mat(matrix.tolist()) * (-s * flint.arb(tau)).exp()
        values.append(total.det())
    turns = flint.arb(0)
    for k, value in enumerate(values):
        angle = (values[(k + 1) % len(values)] / value).arg()
        assert abs(angle) < 1.5
        turns += angle
    number = turns / (2 * flint.arb.pi())
    return round(float(number.mid()))


@pytest.mark.parametrize("n", [8, *(pytest.param(n, marks=pytest.mark.survey) for n in (12, 15))])
def test_ball_arithmetic_counts_the_same(n):
    system = random_system(100 + n, n)
    re, im = (-1.0, 3.0), (0.5, 6.0)
    assert system.count(re, im) == ball_winding(system, re, im)


# Properties


@settings(max_examples=12)
@given(st.integers(0, 10**6), st.integers(2, 7), st.floats(-1.5, 1.0), st.floats(1.0, 9.0))
def test_the_count_of_a_region_is_the_sum_over_its_parts(seed, n, x, y):
    matrix = matrix_of(random_system(seed, n))
    re, im = (-3.0, 4.0), (-12.0, 12.0)
    try:
        parts = [
            matrix.count(a, b)
            for a in ((re[0], x), (x, re[1]))
            for b in ((im[0], -y), (-y, y), (y, im[1]))
        ]
        whole = matrix.count(re, im)
    except dtm.ContourError:
        return
    assert sum(parts) == whole
    assert parts[0] == parts[2]
    assert parts[3] == parts[5]


@settings(max_examples=8)
@given(st.integers(0, 10**6), st.integers(2, 8), st.booleans())
def test_similar_systems_have_the_same_roots(seed, n, neutral):
    system = random_system(seed, n, neutral)
    there, back = unimodular(np.random.default_rng(seed), n)
    # Powers of two and permutations are exact; the product with an integer matrix nearly so.
    scale = 2.0 ** np.random.default_rng(seed).integers(-6, 7, size=n)
    turned = DelaySystem(
        {tau: (there @ A @ back) * scale[:, None] / scale for tau, A in system.A.items()},
        N={tau: (there @ N @ back) * scale[:, None] / scale for tau, N in system.N.items()},
    )
    re, im = (-2.0, 4.0), (-9.0, 9.0)
    one, other = matrix_of(system).roots(re, im), matrix_of(turned).roots(re, im)
    assert one.counted == other.counted
    for root in one.roots:
        assert abs(other.roots - root).min() < 1e-8
    # Conjugate symmetry.
    assert sorted(one.roots.tolist(), key=repr) == sorted(one.roots.conj().tolist(), key=repr)


def test_time_in_other_units():
    slow = random_system(7, 12)
    fast = DelaySystem({tau / 1000: 1000 * A for tau, A in slow.A.items()})
    assert fast.rightmost(2).roots == pytest.approx(1000 * slow.rightmost(2).roots, rel=1e-9)


# Neutral systems


def test_chains_of_commuting_matrices():
    # diag(a) at 0.5, diag(b) at 1.3: each state alone solves |a| x + |b| x^2.6 = 1.
    a, b = np.array([0.3, -0.5, 0.1]), np.array([0.2, 0.25, -0.6])
    system = DelaySystem(-np.eye(3), N={0.5: np.diag(a), 1.3: np.diag(b)})
    low, high = system.chain_enclosure()
    each = [
        float(mp.findroot(lambda c, p=p, q=q: p * mp.exp(-c / 2) + q * mp.exp(-1.3 * c) - 1, -0.5))
        for p, q in zip(abs(a).tolist(), abs(b).tolist(), strict=True)
    ]
    assert low <= max(each) <= high
    assert high - low < 1e-3
    assert system.chain_abscissa() == high


def test_one_delay_has_the_spectral_radius():
    rng = np.random.default_rng(3)
    for n in (2, 5, 15):
        N = rng.normal(size=(n, n)) / n
        low, high = DelaySystem(-np.eye(n), N={0.7: N}).chain_enclosure()
        exact = math.log(abs(np.linalg.eigvals(N)).max()) / 0.7
        assert low <= exact + 1e-12
        assert exact - 1e-12 <= high
        assert high - low < 1e-4


def test_products_of_delays_are_not_delays_of_their_own():
    # det (I + N1 z1 + N2 z2) = 1 + 0.5 z1 z2 for these two: the expansion has one composite delay,
    # and C_D solves 0.5 e^(-3 c) = 1.
    N = {1.0: [[0.0, 1.0], [0.0, 0.0]], 2.0: [[0.0, 0.0], [-0.5, 0.0]]}
    low, high = DelaySystem(-np.eye(2), N=N).chain_enclosure()
    exact = math.log(0.5) / 3
    assert low <= exact <= high
    assert high - low < 1e-3
    # (1 + 0.5 z1) (1 + 0.6 z2) = 1 + 0.5 z1 + 0.6 z2 + 0.3 z1 z2: stable chains, although the
    # moduli of the coefficients add up to 1.4.
    system = DelaySystem(-np.eye(2), N={1.0: np.diag([0.5, 0]), 1.5: np.diag([0, 0.6])})
    assert system.characteristic().chain_abscissa() > 0
    exact = max(math.log(0.5), math.log(0.6) / 1.5)
    low, high = system.chain_enclosure()
    assert low <= exact <= high < 0
    assert high - low < 1e-3
    assert system.is_stable()
    assert not system.characteristic().is_stable()
    assert system.is_stable(strong=False)
    assert system.spectral_abscissa() < 0


def test_neutral_systems_of_many_states():
    n = 12
    rng = np.random.default_rng(12)
    there, back = unimodular(rng, n)
    late = rng.integers(1, 5, size=n) / 8
    system = DelaySystem(
        {0.0: -2.0 * np.eye(n), 0.5: there @ np.diag(late) @ back},
        N={0.5: there @ np.diag(-late) @ back},
    )
    # Each part: s (1 - d z) + 2 - d z.
    low, high = system.chain_enclosure()
    assert low - 1e-9 <= math.log(late.max()) / 0.5 <= high
    # The powers of a matrix far from normal lose digits.
    assert high - low < 2e-3
    assert system.is_stable()
    parts = sum(
        (dtm.s * (1 - d * dtm.delay(0.5)) + 2 - d * dtm.delay(0.5)).count((-1.3, 1), (-40, 40.5))
        for d in late.tolist()
    )
    assert system.count((-1.3, 1), (-40, 40.5)) == parts
    assert system.count(re=(-0.5, None)) == 0
    decoupled = DelaySystem(-np.eye(n), N={0.5: 1.01 * np.eye(n)})
    assert not decoupled.is_stable()
    assert not decoupled.is_stable(strong=False)
    unstable = DelaySystem(-np.eye(n), N={0.5: 1.01 * there @ back[::-1]})
    assert not unstable.is_stable()
    with pytest.raises(ValueError, match="strong=False"):
        unstable.is_stable(strong=False)


# Which path answers


def test_lightly_damped_modes_that_no_expansion_separates():
    modes = np.zeros((10, 10))
    omegas = (1.0, 1.01, 1.02, 1.03, 1.04)
    for i, omega in enumerate(omegas):
        modes[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, 1], [-(omega**2), -1e-3]]
    system = DelaySystem(modes)
    with pytest.raises(ValueError, match="expanding the determinant"):
        system.characteristic()
    upper = system.poles(re=(-1, 1), im=(0.5, 2)).roots
    assert np.sort(upper.imag) == pytest.approx([math.sqrt(w * w - 2.5e-7) for w in omegas])
    assert upper.real == pytest.approx(-5e-4, rel=1e-9)
    assert system.is_stable()


def test_multiple_roots_are_held_by_one_disc():
    system = DelaySystem({1.0: -np.eye(12)})
    found = system.poles(re=(-1, 1), im=(0, 3))
    assert found.multiplicities.tolist() == [12]
    assert found.resolved[0]
    assert abs(found.roots[0] - complex(dtm.lambertw(-1.0))) <= found.radii[0] + 1e-15
    assert found.radii[0] < 1e-13


def test_defective_roots_are_held_by_one_disc():
    # A Jordan block: bounds by norms shrink with the square of the distance.
    system = matrix_of(DelaySystem([[-1.0, -0.08, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]))
    found = system.rightmost()
    assert found.counted == 3
    assert abs(found.roots[0] + 1) <= found.radii[0] < 0.01
    assert matrix_of(DelaySystem({0.0: 0.0, 1.0: 0.0})).rightmost().roots.tolist() == [0]


def test_far_to_the_left_nothing_overflows():
    n = 11
    system = DelaySystem({0.0: -np.eye(n), 1.0: 0.5 * np.roll(np.eye(n), 1, axis=1)})
    assert system.count(re=(-900, -800), im=(-10, 10)) == 0
    assert system.count(re=(800, 900), im=(-10, 10)) == 0


def test_zeros_from_one_input_to_one_output():
    system = random_system(31, 4)
    system = DelaySystem(
        system.A, {0.0: [[1.0], [0], [0], [2]], 0.2: np.ones((4, 1))}, [[1, 0, 1, 0]]
    )
    h = system.transfer_function().num
    re, im = (-3, 5), (-10, 10)
    assert_holds(system.zeros(re, im), h.roots(re, im).roots.tolist(), room=1e-9)
    with pytest.raises(IndexError, match="output=1"):
        system.zeros(re, im, output=1)
    with pytest.raises(ValueError, match=r"E is singular"):
        system.zeros((0, None), im)


# Hostile inputs


@pytest.mark.parametrize(
    ("make", "ask", "message"),
    [
        (lambda: DelaySystem(np.zeros((12, 12)), E=np.zeros((12, 12))), "count", "zero"),
        (lambda: DelaySystem(np.ones((12, 12)), E=np.ones((12, 12))), "count", "zero for every"),
        (lambda: DelaySystem(np.full((12, 12), 1e200)), "count", "1e100"),
        (
            lambda: DelaySystem(np.ones((12, 12)) - np.eye(12), E=np.diag([0.0] + [1.0] * 11)),
            "rightmost",
            "E is sing",
        ),
        (lambda: DelaySystem({1.0: np.eye(12)}), "poles", "left"),
        (lambda: DelaySystem(np.eye(300)), "count", "300 states"),
        (lambda: DelaySystem(-np.eye(12), N={1.0: np.eye(12)}), "right", "chain"),
    ],
)
def test_what_cannot_be_answered_is_refused(make, ask, message):
    system = make()
    asked = {
        "count": lambda: system.count((-1, 1), (-1.5, 1)),
        "poles": lambda: system.poles(re=(None, 1)),
        "rightmost": system.rightmost,
        "right": lambda: system.count(re=(-1, None)),
    }
    with pytest.raises(ValueError, match=message):
        asked[ask]()


def test_a_root_on_the_edge_is_reported():
    system = DelaySystem(np.diag(np.arange(1.0, 13.0)))
    with pytest.raises(dtm.ContourError, match="touches 3"):
        system.count(re=(3, 5.5), im=(-1, 1.5))
    for re, im in [((1, 0), None), ((math.nan, 1), None), (None, (2, 2))]:
        with pytest.raises(ValueError, match="range"):
            system.count(re, im)
    with pytest.raises(TypeError, match="give a range"):
        system.count(re=3)
    with pytest.raises(ValueError, match="at least 1"):
        system.rightmost(0)


def test_entries_of_very_different_size():
    n = 14
    scale = 10.0 ** np.linspace(-20, 20, n)
    A = np.diag(np.arange(-1.0, -n - 1, -1)) + np.diag(np.full(n - 1, 0.5), 1)
    system = DelaySystem(A * scale[:, None] / scale)
    assert system.count(re=(-n - 0.5, 0), im=(-1, 1.5)) == n


def test_singular_e_with_closed_sides():
    n = 12
    E = np.diag([1.0] * (n - 1) + [0.0])
    A = np.diag(-np.arange(1.0, n + 1))
    system = DelaySystem({0.0: A, 0.5: 0.01 * np.eye(n, k=1)}, E=E)
    assert system.count(re=(-20, 1), im=(-3, 3.5)) >= n - 1


@pytest.mark.usefixtures("listens_to_ctrl_c")
def test_ctrl_c_stops_a_long_search():
    system = random_system(5, 40)
    timer = threading.Timer(0.3, signal.raise_signal, [signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        system.poles(re=(-8, 8), im=(0, 4000))
    timer.join()
