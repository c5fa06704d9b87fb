"""Delay systems: expansion of the determinant against mpmath, responses, refusals."""

import copy
import math
import pickle

import deadtime as dtm
import mpmath as mp
import numpy as np
import pytest
from deadtime import DelaySystem, delay, s
from hypothesis import given, settings, strategies as st

RNG = np.random.default_rng(20)


def random_system(n, p=2, q=2, delays=(0.3, 0.75), neutral=True):
    draw = RNG.normal
    return DelaySystem(
        {0.0: draw(size=(n, n)) - 2 * np.eye(n), delays[0]: draw(size=(n, n))},
        {0.0: draw(size=(n, p)), delays[1]: draw(size=(n, p))},
        {delays[0]: draw(size=(q, n))},
        draw(size=(q, p)),
        N={delays[1]: 0.1 * draw(size=(n, n))} if neutral else None,
    )


def exact_matrix(system, z):
    """Characteristic matrix in the working precision of mpmath."""
    z = mp.mpc(z)
    n = system.n_states
    total = z * mp.matrix(system.E.tolist())
    for tau, part in system.A.items():
        total -= mp.matrix(part.tolist()) * mp.exp(-z * mp.mpf(tau))
    for tau, part in system.N.items():
        total += z * mp.matrix(part.tolist()) * mp.exp(-z * mp.mpf(tau))
    assert total.rows == n
    return total


def size_of(h, z):
    """Sum of the moduli of the terms of h."""
    powers = abs(z) ** np.arange(h.degree + 1)
    return float(np.exp(-z.real * h.delays) @ (np.abs(h.coefficients) @ powers))


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
def test_the_expansion_is_the_determinant(n):
    system = random_system(n)
    h = system.characteristic()
    with mp.workdps(50):
        for z in (0.3 + 1j, -0.5 + 4j, 2.0 - 0.2j, 0.01 + 30j):
            wanted = mp.det(exact_matrix(system, z))
            # One rounding of each coefficient and delay, and those of evaluating h.
            unit = 2.3e-16 * (20 + abs(z) * h.delays[-1])
            assert abs(mp.mpc(h(z)) - wanted) <= unit * size_of(h, z)


@pytest.mark.parametrize("n", [2, 4, 6])
def test_poles_are_poles_of_the_matrices(n):
    system = random_system(n, neutral=False)
    found = system.rightmost(4)
    assert found.counted >= 4
    with mp.workdps(50):
        for root in found:
            exact = mp.findroot(lambda z: mp.det(exact_matrix(system, z)), mp.mpc(root))
            # The growth allowed is 1e4 times what rounding the entries costs.
            assert abs(exact - mp.mpc(root)) < 1e-10 * max(1.0, abs(root))
    matrix = system.characteristic_matrix(np.array(found))
    values = np.linalg.svd(matrix)[1]
    assert (values[:, -1] < 1e-10 * values[:, 0]).all()


def test_known_systems():
    assert DelaySystem(A={0.36: -2.0}).characteristic() == s + 2 * delay(0.36)
    assert DelaySystem(-1.0, N={1.0: -0.5}).characteristic() == s - 0.5 * s * delay(1.0) + 1
    pendulum = DelaySystem({0.0: [[0, 1], [9, 0]], 0.1: [[0, 0], [-20, -4]]})
    assert pendulum.characteristic() == s**2 - 9 + (20 + 4 * s) * delay(0.1)
    assert pendulum.is_stable() == pendulum.characteristic().is_stable()
    # A descriptor system: the second equation is algebraic, u = -2 x(t - 0.36).
    loop = DelaySystem({0.0: [[0, 1], [0, -1]], 0.36: [[0, 0], [-2, 0]]}, E=[[1, 0], [0, 0]])
    h = loop.characteristic()
    assert h == s + 2 * delay(0.36)
    assert loop.spectral_abscissa() == h.spectral_abscissa()
    assert loop.rightmost()[0] == h.rightmost()[0]
    assert loop.poles(re=(-5, 1), im=(0, 10)).counted == h.count(re=(-5, 1), im=(0, 10))


def test_delays_add_up_once():
    # Five delays of 0.1 add up to the double next to 5 fl(0.1), not to the sum rounded each time.
    n = 5
    ring = np.roll(np.eye(n), 1, axis=1)
    h = DelaySystem({0.0: -np.eye(n), 0.1: 0.5 * ring}).characteristic()
    assert h.delays.tolist() == [0.0, 0.5]
    z = 0.2 + 1j
    assert h(z) == pytest.approx((z + 1) ** 5 - 0.5**5 * np.exp(-0.5 * z), rel=1e-14)


@pytest.mark.parametrize("shape", [(), (3,), (2, 3)])
def test_frequency_responses_of_several_inputs_and_outputs(shape):
    system = random_system(5, p=3, q=2)
    omega = np.linspace(0.1, 9.0, math.prod(shape)).reshape(shape)
    response = system.frequency_response(omega)
    assert response.shape == (2, 3, *shape)
    for i in range(2):
        for j in range(3):
            G = system.transfer_function(i, j)
            np.testing.assert_allclose(G(1j * omega), response[i, j], rtol=1e-10)
    with mp.workdps(30):
        at = 1j * float(omega.flat[0])
        B = sum(
            (mp.matrix(b.tolist()) * mp.exp(-mp.mpc(at) * mp.mpf(t)) for t, b in system.B.items()),
            mp.zeros(5, 3),
        )
        (tau, C), = system.C.items()  # fmt: skip
        C = mp.matrix(C.tolist()) * mp.exp(-mp.mpc(at) * mp.mpf(tau))
        wanted = C * mp.inverse(exact_matrix(system, at)) * B + mp.matrix(system.D[0.0].tolist())
        first = response.reshape(2, 3, -1)[..., 0]
        for i in range(2):
            for j in range(3):
                assert abs(mp.mpc(complex(first[i, j])) - wanted[i, j]) < 1e-11


def test_python_control_agrees_without_delay():
    control = pytest.importorskip("control", reason="python-control is not installed")
    A, B = RNG.normal(size=(4, 4)) - 3 * np.eye(4), RNG.normal(size=(4, 2))
    C, D = RNG.normal(size=(3, 4)), RNG.normal(size=(3, 2))
    ours, theirs = DelaySystem(A, B, C, D), control.ss(A, B, C, D)
    omega = np.geomspace(0.1, 10, 7)
    np.testing.assert_allclose(ours.frequency_response(omega), theirs(1j * omega), rtol=1e-10)
    np.testing.assert_allclose(
        np.sort_complex(ours.poles()), np.sort_complex(theirs.poles()), rtol=1e-9
    )


@pytest.mark.parametrize("states", [8, pytest.param(10, marks=pytest.mark.survey)])
def test_many_states_are_expanded(states):
    system = random_system(states, p=1, q=1, neutral=False)
    G = system.transfer_function()
    omega = np.array([0.1, 1.0, 5.0])
    np.testing.assert_allclose(
        G.frequency_response(omega), system.frequency_response(omega)[0, 0], rtol=1e-8
    )


def test_transfer_functions_name_hidden_modes():
    system = DelaySystem([[1.0, 0.0], [0.0, -2.0]], [[0.0], [1.0]], [[1.0, 1.0]])
    G = system.transfer_function()
    assert G.hidden_modes().tolist() == [1.0]
    assert (system.is_stable(), G.den.is_stable(), G.is_stable()) == (False, False, True)
    G = DelaySystem(-np.eye(2), {0: np.eye(2)}).transfer_function(0, 1)
    assert not G.num.coefficients.any()
    for index in (2, -1):
        with pytest.raises(IndexError, match=f"output={index}"):
            system.transfer_function(output=index)
    with pytest.raises(IndexError, match="input=1"):
        system.transfer_function(input=1)


def test_a_loop_as_a_system_and_as_a_loop():
    loop = dtm.ControlLoop(dtm.Integrator(0.9, 0.2), dtm.PV(2.0, 0.3), delay=0.36)
    closed = DelaySystem(
        {0.0: [[0, 1], [0, -5]], 0.36: [[0, 0], [-9.0, -1.35]]}, {0.36: [[0], [9.0]]}, [[1, 0]]
    )
    z = np.array([0.5 + 2j, -1 + 1j])
    np.testing.assert_allclose(closed.transfer_function()(z), loop.closed_loop()(z), rtol=1e-13)
    assert closed.spectral_abscissa() == pytest.approx(loop.spectral_abscissa(), rel=1e-11)


# What is refused


def test_large_systems_answer_without_the_determinant():
    big = DelaySystem({0.0: -np.eye(30), 0.5: np.roll(np.eye(30), 1, axis=1) * 0.5}, np.eye(30))
    assert big.frequency_response([0.0, 1.0]).shape == (30, 30, 2)
    assert big.characteristic_matrix(1j).shape == (30, 30)
    with pytest.raises(ValueError, match="30 states is not expanded"):
        big.characteristic()
    assert big.is_stable()
    assert big.count(re=(0, None)) == 0


def test_expansions_that_would_lose_the_roots_are_refused():
    # Five lightly damped modes next to one another: where they are, the terms of the product
    # cancel to one part in 1e12.
    modes = np.zeros((10, 10))
    for i, omega in enumerate((1.0, 1.01, 1.02, 1.03, 1.04)):
        modes[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, 1], [-(omega**2), -1e-3]]
    with pytest.raises(ValueError, match=r"times as far as rounding the entries"):
        DelaySystem(modes).characteristic()
    # Two of them are no trouble, and time in other units makes no difference.
    two = DelaySystem(modes[:4, :4])
    assert two.rightmost(2).roots.real == pytest.approx(-5e-4, rel=1e-8)
    assert DelaySystem(1e6 * modes[:4, :4]).rightmost(2).roots.real == pytest.approx(-500.0)


def test_too_many_terms_are_refused():
    full = {0.1 * k + 0.01 * k**3: RNG.normal(size=(5, 5)) for k in range(9)}
    with pytest.raises(ValueError, match="more than 1000 terms"):
        DelaySystem(full).characteristic()


def test_singular_equations_are_refused():
    with pytest.raises(ValueError, match="zero for every s"):
        DelaySystem([[1.0, 1.0], [0.0, 0.0]], E=[[1, 0], [0, 0]]).characteristic()


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: DelaySystem({}), ValueError, "A is empty"),
        (lambda: DelaySystem(np.zeros((0, 0))), ValueError, "A is empty"),
        (lambda: DelaySystem([[1, 2]]), ValueError, "A with delay 0 s has shape"),
        (lambda: DelaySystem({-1.0: 1.0}), ValueError, "delay of A"),
        (lambda: DelaySystem({math.nan: 1.0}), ValueError, "delay of A"),
        (lambda: DelaySystem({"a": 1.0}), TypeError, "delay of A"),
        (lambda: DelaySystem(1j), TypeError, "A has the dtype"),
        (lambda: DelaySystem(math.inf), ValueError, "A contains inf"),
        (lambda: DelaySystem([1.0, 2.0]), ValueError, "give a matrix"),
        (lambda: DelaySystem(-np.eye(2), np.eye(2)), ValueError, r"\{0: A0, tau: A1\}"),
        (lambda: DelaySystem({0: -np.eye(3)}, np.eye(3), N={}), ValueError, r"B=\{0: B\}"),
        (lambda: DelaySystem(1.0, [[1], [2]]), ValueError, "B with delay 0 s"),
        (lambda: DelaySystem(1.0, 1.0, [[1, 2]]), ValueError, "C with delay 0 s"),
        (lambda: DelaySystem(1.0, 1.0, 1.0, [[1, 2]]), ValueError, "D with delay 0 s"),
        (lambda: DelaySystem(1.0, E=np.eye(2)), ValueError, "E with delay 0 s"),
        (lambda: DelaySystem(1.0, N={0.0: 1.0}), ValueError, "the matrix of x'\\(t\\) is E"),
        (lambda: DelaySystem(1.0, N=1.0), TypeError, "N: give a dict"),
        (lambda: DelaySystem(1e200 * np.eye(2)).characteristic(), ValueError, "1e308"),
    ],
)
def test_what_does_not_fit_is_refused(make, error, message):
    with pytest.raises(error, match=message):
        make()


def test_it_does_not_change_and_survives_copying():
    given = np.array([[0.0, 1.0], [-4.0, -0.4]])
    system = DelaySystem({0.0: given, 0.5: np.eye(2)}, {0.1: [[0], [1]]}, N={0.2: 0.1 * np.eye(2)})
    given[0, 0] = 7.0
    assert system.A[0.0][0, 0] == 0.0
    with pytest.raises(AttributeError):
        system.A = {}
    with pytest.raises(AttributeError):
        del system._A
    system.A.clear()
    for one in (
        system,
        pickle.loads(pickle.dumps(system)),
        copy.copy(system),
        copy.deepcopy(system),
    ):
        assert repr(one) == "<DelaySystem: 2 states, 1 inputs, 2 outputs, delays 0.1, 0.2, 0.5 s>"
        assert one.characteristic() == system.characteristic()
        assert one.delays.tolist() == [0.1, 0.2, 0.5]
        for part in (*one.A.values(), *one.B.values(), *one.C.values(), one.E, *one.N.values()):
            assert not part.flags.writeable


@settings(max_examples=25)
@given(
    st.integers(1, 4),
    st.floats(0.1, 2.0),
    st.floats(0.5, 4.0),
    st.randoms(use_true_random=False),
)
def test_time_in_other_units(n, tau, factor, random):
    """Scaling (s, tau) by (c, 1/c) scales the roots: the determinant by c^n."""
    A = np.array([[random.uniform(-2, 2) for _ in range(n)] for _ in range(n)])
    B = np.array([[random.uniform(-2, 2) for _ in range(n)] for _ in range(n)])
    slow = DelaySystem({0.0: A, tau: B}).characteristic()
    fast = DelaySystem({0.0: factor * A, tau / factor: factor * B}).characteristic()
    z = 0.3 + 1.1j
    wanted = factor**n * slow(z)
    assert abs(fast(factor * z) - wanted) <= 1e-13 * factor**n * size_of(slow, z)
