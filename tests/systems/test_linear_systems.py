"""Simulation of linear systems with delays, against references, closed forms and other methods."""

import copy
import json
import math
import pickle
import re
from pathlib import Path

import deadtime as dtm
import mpmath
import numpy as np
import pytest
from deadtime.gallery import _access as gallery
from hypothesis import given, settings, strategies as st
from scipy import signal

PROBLEMS = {
    problem["id"]: problem
    for problem in json.loads(
        (Path(__file__).parents[1] / "reference" / "dde_problems.json").read_text(encoding="utf-8")
    )["problems"]
}


def reference(key):
    problem = PROBLEMS[key]
    values = np.array([[float(v) for v in row] for row in problem["values"]]).T
    return np.array([float(t) for t in problem["times"]]), values


def prothero():
    lam, c = 1000.0, 500.0
    return dtm.DelaySystem({0.0: -lam, 1.0: c}, 1.0), {
        "inputs": lambda t: lam * math.cos(t) - math.sin(t) - c * math.cos(t - 1),
        "history": math.cos,
        "initial_state": 2.0,
    }


LINEAR = {
    "drone_p_step": (dtm.DelaySystem({0.36: -1.31}, 1.31), {}),
    "drone_pv_neutral": (dtm.DelaySystem({0.36: -2.0}, 2.0, N={0.36: 0.3}), {}),
    "ddeprob_1delay_jump": (dtm.DelaySystem({1.0: -1.0}), {"initial_state": 1.0}),
    "ddeprob_2delays_jump": (dtm.DelaySystem({1 / 3: -1.0, 0.2: -1.0}), {"initial_state": 1.0}),
    "long_lightly_damped": (dtm.DelaySystem({1.0: -(math.pi / 2 - 0.01)}), {"history": 1.0}),
    "kinked_history": (
        dtm.DelaySystem({0.0: 0.5, 1.0: -2.0}),
        {"history": lambda t: abs(t + 0.5), "history_breaks": [-0.5]},
    ),
    "stiff_prothero_delay": prothero(),
}


@pytest.mark.parametrize("key", LINEAR)
def test_the_problems_of_the_file_are_solved_to_rounding(key):
    times, truth = reference(key)
    system, arguments = LINEAR[key]
    found = system.simulate(np.concatenate([[0.0], times]), **arguments)
    outputs = np.atleast_2d(found.outputs)[:, 1:]
    # 500 delays of an oscillation add up a few hundred units of rounding.
    assert np.abs(outputs - truth).max() < 1e-12 * np.abs(truth).max()
    kinks = PROBLEMS[key]["discontinuity_times"]
    if isinstance(kinks, list):
        known = [t for t in (float(k) for k in kinks) if t <= times[-1]]
        assert all(np.abs(found.breaks - t).min() < 1e-9 for t in known[:10])


numbers = st.floats(0.1, 3.0)


@settings(max_examples=40, deadline=None)
@given(
    gain=numbers,
    kp=numbers,
    kv=st.floats(-0.6, 0.6),
    delay=st.floats(0.05, 1.0),
    lag=st.sampled_from([0.0, 0.1, 0.5]),
    kind=st.sampled_from(["P", "PV", "PV filtered", "PI"]),
)
def test_loops_agree_with_their_own_simulation(gain, kp, kv, delay, lag, kind):
    controller = {
        "P": dtm.P(kp),
        "PV": dtm.PV(kp, kv / gain),
        "PV filtered": dtm.PV(kp, kv / gain, filter=dtm.DerivativeFilter(25.0, damping=0.7)),
        "PI": dtm.PI(kp, 0.4),
    }[kind]
    loop = dtm.ControlLoop(dtm.Integrator(gain, lag), controller, delay=delay)
    times = np.linspace(0.0, 8.0 * delay, 57)
    truth = loop.simulate(times).outputs
    G = gain / (dtm.s * (lag * dtm.s + 1.0) if lag else dtm.s) * dtm.delay(delay)
    forward, back = dtm.TransferFunction(kp), dtm.TransferFunction(0.0)
    if kind.startswith("PV"):
        H = dtm.s if kind == "PV" else 625.0 * dtm.s / (dtm.s**2 + 35.0 * dtm.s + 625.0)
        back = dtm.TransferFunction(kv / gain * dtm.s) if kind == "PV" else kv / gain * H
    if kind == "PI":
        forward = (kp * dtm.s + 0.4) / dtm.s
    T = dtm.feedback(forward * G, (forward + back) / forward)
    found = T.step_response(times)
    assert np.abs(found.outputs - truth).max() <= 1e-13 * max(1.0, np.abs(truth).max())


@pytest.mark.parametrize("interpolation", ["hold", "linear"])
def test_several_inputs_and_outputs_without_delay_agree_with_scipy(interpolation):
    rng = np.random.default_rng(5)
    A, B = rng.normal(size=(5, 5)) - 2.0 * np.eye(5), rng.normal(size=(5, 2))
    C, D = rng.normal(size=(3, 5)), rng.normal(size=(3, 2))
    times = np.linspace(0.0, 4.0, 81)
    inputs = rng.normal(size=(2, 81))
    start = rng.normal(size=5)
    found = dtm.DelaySystem(A, B, C, D).simulate(
        times, inputs, interpolation=interpolation, initial_state=start
    )
    _, outputs, states = signal.lsim(
        signal.StateSpace(A, B, C, D), inputs.T, times, start, interp=interpolation == "linear"
    )
    # Both are good to rounding of the states, which the outputs of scipy add up step by step.
    assert found.outputs.shape == (3, 81)
    assert np.abs(found.states - states.T).max() < 1e-12
    assert np.abs(found.outputs - outputs.T).max() < 1e-12
    assert np.allclose(found.inputs, inputs, rtol=0.0, atol=1e-15)


def series_of_delays(t, rows, start):
    """x' = sum a_j x(t - tau_j), zero before x(0) = start: a sum over all words of delays."""
    with mpmath.workdps(40):
        level, total, order = {mpmath.mpf(0): mpmath.mpf(start)}, mpmath.mpf(0), 0
        while level:
            for age, weight in level.items():
                total += weight * (t - age) ** order / mpmath.factorial(order)
            following = {}
            for age, weight in level.items():
                for tau, a in rows:
                    if age + tau < t:
                        key = age + mpmath.mpf(tau)
                        following[key] = following.get(key, 0) + weight * mpmath.mpf(a)
            level, order = following, order + 1
        return float(total)


def test_incommensurate_delays_agree_with_the_series_of_powers():
    rows = ((math.sqrt(2) / 4, -0.9), (math.e / 8, -0.8), (math.pi / 5, 0.5))
    times = np.linspace(0.0, 5.0, 23)
    found = dtm.DelaySystem(dict(rows)).simulate(times, initial_state=1.0)
    truth = np.array([series_of_delays(mpmath.mpf(t), rows, 1.0) for t in times[1:]])
    assert np.abs(found.states[0, 1:] - truth).max() < 2e-14


def neutral_series(t, rows, a):
    """z + sum n_j z(t - tau_j) = a-fold integral response, by words of two neutral delays.

    x' + sum n_j x'(t - tau_j) = a x + 1 from rest, by expansion of 1/(s (s - a + s sum n_j z_j))
    in the z_j: the term of words with k letters is s^(k-1) / (s - a)^(k+1).
    """
    with mpmath.workdps(40):
        level, total, k = {mpmath.mpf(0): mpmath.mpf(1)}, mpmath.mpf(0), 0
        a = mpmath.mpf(a)
        while level:
            for age, weight in level.items():
                u = t - age
                # Inverse transform of s^(k-1)/(s-a)^(k+1), for k = 0 (e^(a u) - 1)/a.
                if k == 0:
                    value = mpmath.expm1(a * u) / a
                else:
                    value = mpmath.exp(a * u) * mpmath.fsum(
                        mpmath.binomial(k - 1, j) * a**j * u ** (j + 1) / mpmath.factorial(j + 1)
                        for j in range(k)
                    )
                total += weight * value
            following = {}
            for age, weight in level.items():
                for tau, n in rows:
                    if age + tau < t:
                        key = age + mpmath.mpf(tau)
                        following[key] = following.get(key, 0) - weight * mpmath.mpf(n)
            level, k = following, k + 1
        return float(total)


def test_a_neutral_system_with_two_delays_agrees_with_its_series():
    rows, a = ((0.5, 0.4), (1.0 / math.sqrt(3.0), -0.3)), -0.7
    system = dtm.DelaySystem(a, 1.0, N=dict(rows))
    times = np.linspace(0.0, 6.0, 25)
    found = system.simulate(times)
    truth = np.array([neutral_series(mpmath.mpf(t), rows, a) for t in times[1:]])
    assert np.abs(found.outputs[1:] - truth).max() < 2e-14


def test_a_jump_of_a_neutral_state_returns():
    # x + x(t - 1)/2 has no jump after the start, and no forcing: it stays 1 from there on.
    system = dtm.DelaySystem(0.0, N={1.0: 0.5})
    found = system.simulate([0.0, 0.5, 1.0, 1.5, 2.5], initial_state=1.0)
    assert np.allclose(found.states[0], [1.0, 1.0, 0.5, 0.5, 0.75], atol=1e-15)


delays = st.lists(st.floats(0.1, 1.3), min_size=1, max_size=3, unique=True)
entries = st.floats(-2.0, 2.0)


@st.composite
def systems(draw):
    n = 2

    def matrix(bound=2.0):
        return [[draw(st.floats(-bound, bound)) for _ in range(n)] for _ in range(n)]

    A = {0.0: matrix(), **{tau: matrix() for tau in draw(delays)}}
    N = {draw(st.floats(0.1, 1.0)): matrix(0.3)} if draw(st.booleans()) else None
    B = {0.0: [[1.0], [0.5]], draw(st.floats(0.05, 0.8)): [[-0.5], [1.0]]}
    return dtm.DelaySystem(A, B, [[1.0, -1.0]], N=N)


@settings(max_examples=25, deadline=None)
@given(system=systems(), p=entries, q=entries)
def test_responses_superpose(system, p, q):
    times = np.linspace(0.0, 3.0, 31)
    first = {"inputs": np.sin, "history": 0.0, "initial_state": [1.0, 0.0]}
    second = {"inputs": np.cos, "history": [0.5, -1.0], "initial_state": None}
    both = {
        "inputs": lambda t: p * np.sin(t) + q * np.cos(t),
        "history": [0.5 * q, -q],
        "initial_state": [p + 0.5 * q, -q],
    }
    one, two, sum_ = (
        system.simulate(times, vectorized=True, **each).outputs for each in (first, second, both)
    )
    size = max(1.0, np.abs(p * one).max(), np.abs(q * two).max())
    # Growth over the run amplifies rounding at its start as it amplifies everything.
    assert np.abs(p * one + q * two - sum_).max() <= 1e-12 * size


@settings(max_examples=25, deadline=None)
@given(system=systems(), shift=st.floats(-5.0, 5.0))
def test_the_response_does_not_depend_on_the_start_time(system, shift):
    times = np.linspace(0.0, 3.0, 31)
    still = system.simulate(times, math.sin, history=[1.0, 2.0])
    moved = system.simulate(times + shift, lambda t: math.sin(t - shift), history=[1.0, 2.0])
    # Times near 5 s are known to 1e-15 s.
    assert np.abs(still.states - moved.states).max() <= 3e-13 * max(1.0, np.abs(still.states).max())


@settings(max_examples=25, deadline=None)
@given(system=systems(), cut=st.floats(0.05, 2.5))
def test_output_times_do_not_change_the_run(system, cut):
    whole = system.simulate([0.0, cut, 3.0], math.sin)
    part = system.simulate([0.0, cut], math.sin)
    size = max(1.0, np.abs(whole.states).max())
    assert np.abs(whole.states[:, 1] - part.states[:, 1]).max() <= 1e-13 * size


def test_held_and_joined_inputs():
    G = dtm.delay(0.5) / dtm.s
    held = G.simulate([0.0, 1.0, 2.0, 3.0], [1.0, -1.0, 2.0, 0.0])
    assert np.allclose(held.outputs, [0.0, 0.5, 0.5, 1.0], atol=1e-15)
    joined = G.simulate([0.0, 1.0, 2.0], [0.0, 2.0, 2.0], interpolation="linear")
    assert np.allclose(joined.outputs, [0.0, 0.25, 2.0], atol=1e-15)
    assert np.allclose(joined.breaks, [0.0, 0.5, 1.0, 1.5])
    kinked = G.simulate([0.0, 3.0], lambda t: abs(t - 1.0), input_breaks=[1.0])
    assert np.allclose(kinked.outputs, [0.0, 0.5 + 1.125], atol=1e-14)
    # An input of before the start arrives as it was.
    system = dtm.DelaySystem(0.0, {0.5: 1.0})
    before = system.simulate([0.0, 0.25, 1.0], 0.0, input_before=2.0)
    assert np.allclose(before.outputs, [0.0, 0.5, 1.0], atol=1e-15)
    lag = (dtm.delay(0.5) / (dtm.s + 2.0)).simulate([0.0, 0.5, 1.5], 0.0, input_before=2.0)
    assert np.allclose(lag.outputs, [1.0, 1.0, math.exp(-2.0)], atol=1e-15)
    with pytest.raises(ValueError, match="pole at zero"):
        G.simulate([0.0, 1.0], 0.0, input_before=2.0)


@pytest.mark.parametrize("span", [0.02, 1.0, 500.0])
def test_a_pulse_of_a_few_thousandths_of_the_run_is_not_missed(span):
    width, start = 4e-3 * span, 0.618 * span

    def pulse(t):
        return np.where((t >= start) & (t < start + width), 1.0, 0.0)

    found = dtm.TransferFunction([1.0], [1.0, 0.0]).simulate([0.0, span], pulse, vectorized=True)
    assert found.outputs[-1] == pytest.approx(width, rel=1e-9)


def test_a_stiff_lag_under_held_samples_is_a_row_of_exponentials():
    rng = np.random.default_rng(1)
    times = 0.05 * np.arange(61)
    levels = rng.normal(size=61)
    rate = 1e5
    found = dtm.DelaySystem(-rate, rate).simulate(times, levels)
    # Each sample has long settled when the next one comes.
    assert np.abs(found.outputs[1:] - levels[:-1]).max() < 1e-13 * np.abs(levels).max()


def test_the_state_at_the_start_is_the_one_given():
    system = dtm.DelaySystem([[0, 1], [-4, -1]], [[0], [4]])
    found = system.simulate([5.0, 6.0], initial_state=[0.1, -0.3])
    assert found.states[:, 0].tolist() == [0.1, -0.3]


def test_a_run_of_noise_does_not_shorten_elements_for_ever():
    """A speed that is zero but for rounding, with three delays: this once took a million steps."""
    A = {tau: np.zeros((5, 5)) for tau in (0.0, 0.3, 0.5, 0.7)}
    A[0.0][:2, :2] = [[0, 1], [-4, -1]]
    A[0.0][2:, 2:] = -np.eye(3)
    A[0.5][2, 1] = A[0.3][3, 2] = A[0.7][4, 3] = 1.0
    found = dtm.DelaySystem(A, [[0], [4], [0], [0], [0]]).simulate([0.0, 300.0, 3000.0])
    assert np.abs(found.states[:, 1:] - [[1], [0], [0], [0], [0]]).max() < 1e-14


def test_transfer_functions_of_every_kind():
    times = np.linspace(0.0, 4.0, 41)
    window = ((1.0 - dtm.delay(0.5)) / dtm.s).step_response(times)
    assert np.allclose(window.outputs, np.minimum(times, 0.5), atol=1e-14)
    lead = ((2.0 * dtm.s + 1.0) / (dtm.s + 1.0) * dtm.delay(1.0)).step_response(times)
    truth = np.where(times < 1.0, 0.0, 1.0 + np.exp(-(times - 1.0)))
    assert np.abs(lead.outputs - truth).max() < 1e-14
    static = dtm.TransferFunction(3.0 * dtm.delay(0.25)).step_response(times)
    assert np.array_equal(static.outputs, np.where(times < 0.25, 0.0, 3.0))
    # Sensitivity of a neutral loop: proper, and jumps for ever.
    L = (2.0 + 0.3 * dtm.s) / dtm.s * dtm.delay(0.36)
    S, T = dtm.feedback(1.0, L), dtm.feedback(L)
    together = S.step_response(times).outputs + T.step_response(times).outputs
    assert np.abs(together - 1.0).max() < 1e-14
    assert abs(T.step_response().steady_state - 1.0) < 1e-15
    system = dtm.DelaySystem([[0, 1], [-4, -0.4]], {0.1: [[0], [1]]}, [[1, 0]])
    by_matrix = system.step_response(times)
    by_ratio = system.transfer_function().step_response(times)
    assert np.abs(by_matrix.outputs - by_ratio.outputs).max() < 1e-14


def stable(problem):
    return problem.h.spectral_abscissa() < -1e-6


@pytest.mark.parametrize(
    "key",
    [
        # The slowest decay of all takes the longest response.
        pytest.param(p.key, marks=pytest.mark.survey) if p.key == "bellen1999" else p.key
        for p in gallery.problems()
        if stable(p)
    ],
)
def test_responses_decay_at_the_rate_of_the_certified_rightmost_root(key):
    """Roots and simulation share no code; both give the decay rate of a perturbation.

    The envelope is the largest state, each weighted by the root's modulus, over windows of one
    half turn of the root (or one time constant), late enough for the second root to be gone.
    """
    h = gallery.problem(key).h
    if h.kind not in ("retarded", "neutral", "polynomial"):
        pytest.skip("a difference equation is not simulated")
    roots = h.rightmost(4)
    if not len(roots) or (h.kind == "neutral" and roots[0].real - h.chain_abscissa() < 0.05):
        pytest.skip("the chain of a neutral equation, countless modes of one rate, sets the decay")
    root = complex(roots[0])
    alpha, omega = root.real, abs(root.imag)
    n = h.degree
    # A cluster of roots acts as a multiple one.
    near = np.abs(roots.roots.real - alpha) + np.abs(np.abs(roots.roots.imag) - omega)
    in_cluster = near < 0.02 * abs(alpha)
    multiplicity = int(roots.multiplicities[in_cluster].sum())
    if omega > 0.02 * abs(alpha):
        multiplicity //= 2
    others = roots.roots.real[~in_cluster]
    chain = h.chain_abscissa()
    gap = alpha - max([*others, chain if math.isfinite(chain) else -math.inf, 60.0 * alpha])
    turn = math.pi / omega if omega > 0.02 * abs(alpha) else 1.0 / abs(alpha)
    # e^-9 of the second mode is left at the beginning of the fit, or it decays as fast within the
    # tolerance; the envelope of a multiple root is t^(m-1) e^(alpha t).
    first = 9.0 / max(gap, 0.05 * abs(alpha)) + 5.0 * float(h.delays[-1])
    windows = max(8, math.ceil(0.5 / (abs(alpha) * turn)))
    count = 40
    times = first + turn * np.arange(windows * count + 1) / count
    leading = h.coefficients[0, n]
    A = {}
    for row, tau in zip(h.coefficients, h.delays, strict=True):
        matrix = np.zeros((n, n))
        matrix[-1] = -row[:n] / leading
        if tau == 0.0:
            matrix += np.diag(np.ones(n - 1), 1)
        A[float(tau)] = matrix
    N = {}
    for row, tau in zip(h.coefficients[1:], h.delays[1:], strict=True):
        N[float(tau)] = np.zeros((n, n))
        N[float(tau)][-1, -1] = row[n] / leading
    system = dtm.DelaySystem(A, N={k: m for k, m in N.items() if m.any()} or None)
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(2, n))

    def history(t):
        return a + b * np.sin(3.0 * t)

    found = system.simulate(np.concatenate([[0.0], times]), history=history)
    weights = np.abs(root) ** -np.arange(n)
    size = (weights[:, None] * np.abs(found.states[:, 1:])).max(axis=0)
    envelope = size[:-1].reshape(windows, count).max(axis=1)
    middle = first + turn * (np.arange(windows) + 0.5)
    rate = np.polyfit(middle, np.log(envelope) - (multiplicity - 1) * np.log(middle), 1)[0]
    # What is left of the second mode, and the lag of a multiple root's power, is a few percent.
    assert rate == pytest.approx(alpha, rel=0.03, abs=1e-9)


def test_a_recorded_step_is_measured_at_its_samples():
    time = 0.01 * np.arange(801)
    found = dtm.systems.Response(time, 1.0 - np.exp(-time), np.ones_like(time), [0.0]).info(
        steady_state=1.0
    )
    assert found["rise_time"] == pytest.approx(math.log(9.0), abs=0.01)
    assert found["settling_time"] == pytest.approx(math.log(50.0), abs=0.01)
    assert found["overshoot"] == 0.0


def test_a_rise_may_be_measured_from_the_first_output_on():
    lag = dtm.TransferFunction([1.0], [1.0, 1.0]).step_response(np.linspace(0.0, 9.0, 31))
    assert lag.info(rise=(0.0, 0.9))["rise_time"] == pytest.approx(math.log(10.0), abs=1e-6)


def test_the_response_is_a_whole_object():
    system = dtm.DelaySystem({0.36: -2.0}, {0.36: 2.0})
    found = system.step_response()
    time, outputs = found
    assert found.info()["overshoot"] == pytest.approx(22.475, abs=1e-3)
    assert found.steady_state == 1.0
    assert outputs.shape == time.shape
    assert not outputs.flags.writeable
    for copied in (pickle.loads(pickle.dumps(found)), copy.deepcopy(found)):
        assert copied.info() == found.info()
        assert not copied.outputs.flags.writeable
    pytest.importorskip("matplotlib").use("Agg")
    assert len(found.plot(inputs=True).lines) == 2
    pair = dtm.DelaySystem(-np.eye(2), {0: np.eye(2)}).step_response([0.0, 1.0], 2.0, input=1)
    assert pair.outputs.shape == (2, 2)
    assert np.allclose(pair.outputs[:, 1], [0.0, 2.0 * -math.expm1(-1.0)], atol=1e-15)
    with pytest.raises(IndexError, match="output=2"):
        pair.info(2)
    with pytest.raises(IndexError, match="input=3"):
        system.step_response([0.0, 1.0], input=3)


ONE = dtm.DelaySystem({0.0: -1.0, 0.5: -1.0}, 1.0)
TWO = dtm.DelaySystem({0.5: -np.eye(2)}, np.eye(2))


@pytest.mark.parametrize(
    ("system", "time", "arguments", "message"),
    [
        (ONE, [0.0, 2.0, 1.0], {}, r"time\[2\]=1.0 is not later than time\[1\]=2.0"),
        (ONE, [], {}, "time is empty"),
        (ONE, [0.0, math.nan], {}, "time contains nan"),
        (ONE, [0.0, 1.0, 2.0], {"inputs": [1.0, math.nan, 0.0]}, "inputs at t = 1.0 s is nan"),
        (
            ONE,
            [0.0, 1.0, 2.0],
            {"inputs": [1.0, 0.0]},
            r"inputs has shape \(2,\), but it must have shape \(3,\)",
        ),
        (
            TWO,
            [0.0, 1.0],
            {"inputs": np.ones((3, 2))},
            r"shape \(3, 2\), but it must have shape \(2, 2\)",
        ),
        (TWO, [0.0, 1.0], {"inputs": 1.0}, r"inputs has shape \(\), but it must have shape \(2,\)"),
        (TWO, [0.0, 1.0], {"inputs": [1, 0], "history": [1.0]}, r"history has shape \(1,\), but"),
        (TWO, [0.0, 1.0], {"inputs": [1, 0], "initial_state": 1.0}, "initial_state has shape"),
        (ONE, [0.0, 1.0], {"history": lambda t: math.nan}, r"history x\(t\) at t = 0.0 s is nan"),
        (
            ONE,
            [0.0, 1.0],
            {"inputs": lambda t: math.nan if t > 0.7 else 0.0},
            r"input u\(t\) at t = 0.7\d* s is nan",
        ),
        (
            ONE,
            [0.0, 1.0],
            {"inputs": lambda t: abs(t - 0.3)},
            r"not smooth at t = 0.3\d* s: give this time in input_breaks",
        ),
        (ONE, [0.0, 1.0], {"interpolation": "cubic"}, "interpolation='cubic'"),
        (dtm.DelaySystem(3.0, 1.0), [0.0, 200.0], {}, r"exceeds 1e150 at t = \d+"),
        (dtm.DelaySystem({1e-9: -1.0}, 1.0), [0.0, 1.0], {}, "more than 20000000 elements"),
        (
            dtm.DelaySystem(np.eye(2), E=np.diag([1, 0])),
            [0, 1.0],
            {},
            "rank 1 but 2 rows.*algebraic",
        ),
        (
            dtm.DelaySystem(np.eye(2), E=np.diag([1, 0]), N={1.0: np.eye(2)}),
            [0, 1.0],
            {},
            "advanced",
        ),
        (dtm.TransferFunction([1.0, 0.0], [1.0]), [0, 1.0], {}, "improper"),
        (1.0 / dtm.TransferFunction(dtm.delay(1.0) * (dtm.s + 1)), [0, 1.0], {}, "not causal"),
        (1.0 / dtm.TransferFunction(1 + 0.5 * dtm.delay(1.0)), [0, 1.0], {}, "difference"),
        (1.0 / dtm.TransferFunction(1 + dtm.s * dtm.delay(1.0)), [0, 1.0], {}, "advanced"),
    ],
)
def test_what_cannot_be_simulated_is_refused_with_the_reason(system, time, arguments, message):
    with pytest.raises(ValueError, match=message):
        system.simulate(time, **arguments)


def test_the_page_on_simulation_runs():
    pytest.importorskip("matplotlib").use("Agg")
    page = Path(__file__).parents[2] / "docs" / "guide/simulating.md"
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 4
    exec("\n".join(blocks), {})


def test_a_transfer_function_has_no_state_to_start_from():
    with pytest.raises(TypeError, match="has no state"):
        (1.0 / (dtm.s + 1.0)).simulate([0.0, 1.0], initial_state=1.0)
