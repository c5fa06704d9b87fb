"""Delay differential equations: reference problems, callbacks, output, history, properties."""

import ctypes
import threading

import deadtime as dtm
import numpy as np
import pytest
import scipy.optimize
from delay_problems import CASES, truth
from hypothesis import given, strategies as st


def decay(t, y, z):
    return -z[0]


def grow(t, y, z):
    return z[0]


# --- reference problems ---------------------------------------------------------------------


@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
@pytest.mark.parametrize("name", CASES)
def test_reference_problems(name, rtol):
    fun, history, delays, more = CASES[name]
    span, times, values = truth(name)
    found = dtm.solve_dde(
        fun,
        span,
        history,
        delays,
        rtol=rtol,
        atol=0.1 * rtol,
        t_eval=times,
        vectorized=True,
        **more,
    )
    assert found.success
    # Tolerances are local; what twenty of them allow is the promise, a part of one the rule.
    assert np.abs(found.y - values).max() <= 20.0 * rtol


@pytest.mark.parametrize("name", ["mackey_glass_a1", "distributed_window", "drone_pv_neutral"])
def test_the_error_falls_with_the_tolerance(name):
    fun, history, delays, more = CASES[name]
    span, times, values = truth(name)
    for rtol in 10.0 ** -np.arange(3, 13):
        found = dtm.solve_dde(
            fun, span, history, delays, rtol=rtol, atol=rtol, t_eval=times, vectorized=True, **more
        )
        assert np.abs(found.y - values).max() <= 20.0 * rtol


def test_long_runs_far_from_zero_keep_their_breaking_points():
    # The delay is 1e-7 of the time: breaking points differ from it by many roundings.
    found = dtm.solve_dde(decay, (1e6, 1e6 + 3.0), 0.0, 0.1, y0=1.0, vectorized=True, rtol=1e-8)
    near = dtm.solve_dde(decay, (0.0, 3.0), 0.0, 0.1, y0=1.0, vectorized=True, rtol=1e-8)
    assert abs(found.y[0, -1] - near.y[0, -1]) < 1e-7
    assert len(found.breaks) == len(near.breaks)


def test_many_delays_and_delays_that_differ_widely():
    rates = np.array([0.3, 0.2, 0.1, 0.05, 0.02])
    delays = np.array([1e-3, 0.5, np.sqrt(2.0), np.pi, 10.0])
    # y = e^(s t) where s = Σ a e^(-s τ).
    s = scipy.optimize.brentq(lambda s: s - rates @ np.exp(-s * delays), 0.0, 1.0)

    def fun(t, y, z):
        return np.einsum("j,jdn->dn", rates, z)

    found = dtm.solve_dde(
        fun, (0.0, 12.0), lambda t: np.exp(s * t), delays, vectorized=True, rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(found.y[0], np.exp(s * found.t), rtol=2e-8, atol=0)


# --- callbacks ------------------------------------------------------------------------------

SIGNATURE = (
    None,
    ctypes.c_double,
    *[ctypes.POINTER(ctypes.c_double)] * 4,
    ctypes.c_void_p,
)


def mackey_glass(t, y, z):
    return 0.2 * z[0] / (1.0 + z[0] ** 10) - 0.1 * y


def compiled_mackey_glass():
    def function(t, y, z, dz, dy, data):
        dy[0] = 0.2 * z[0] / (1.0 + z[0] ** 10) - 0.1 * y[0]

    return ctypes.CFUNCTYPE(*SIGNATURE)(function)


def test_callbacks_agree():
    times = np.linspace(0.0, 60.0, 61)
    arguments = {"t_eval": times, "rtol": 1e-9, "atol": 1e-10}
    together = dtm.solve_dde(mackey_glass, (0, 60), 0.5, 17.0, vectorized=True, **arguments)
    for fun in (
        mackey_glass,
        lambda t, y, z: list(mackey_glass(t, y, z)),
        lambda t, y, z: float(mackey_glass(t, y[0], z[:, 0])),
        compiled_mackey_glass(),
    ):
        found = dtm.solve_dde(fun, (0, 60), 0.5, 17.0, **arguments)
        np.testing.assert_allclose(found.y, together.y, rtol=0, atol=1e-8)


def test_numba_functions_are_called_without_python():
    numba = pytest.importorskip("numba")
    real, pointer = numba.types.float64, numba.types.CPointer(numba.types.float64)
    signature = numba.types.void(real, pointer, pointer, pointer, pointer, numba.types.voidptr)

    @numba.cfunc(signature)
    def window(t, y, z, dz, dy, data):
        dy[0] = -3.0 * y[1] - 0.2 * y[0] ** 3
        dy[1] = y[0] - z[0]

    _, history, delays, _ = CASES["distributed_window"]
    span, times, values = truth("distributed_window")
    found = dtm.solve_dde(window, span, history, delays, t_eval=times, rtol=1e-9, atol=1e-10)
    assert np.abs(found.y - values).max() < 1e-8


def test_low_level_callables_receive_their_user_data():
    rate = ctypes.c_double(-2.0)

    def function(t, y, z, dz, dy, data):
        dy[0] = ctypes.cast(data, ctypes.POINTER(ctypes.c_double))[0] * z[0]

    plain = ctypes.CFUNCTYPE(*SIGNATURE)(function)
    fun = scipy.LowLevelCallable(plain, ctypes.cast(ctypes.pointer(rate), ctypes.c_void_p))
    found = dtm.solve_dde(fun, (0, 1), 1.0, 1.0)
    assert found.y[0, -1] == pytest.approx(-1.0, abs=1e-12)


def test_other_signatures_are_refused():
    square = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(lambda x: x * x)
    for fun in (square, scipy.LowLevelCallable(square)):
        with pytest.raises(ValueError, match="signature"):
            dtm.solve_dde(fun, (0, 1), 1.0, 1.0)
    null = ctypes.CFUNCTYPE(*SIGNATURE)()
    with pytest.raises(ValueError, match="null"):
        dtm.solve_dde(null, (0, 1), 1.0, 1.0)


def test_compiled_functions_take_delayed_slopes_and_python_events():
    def function(t, y, z, dz, dy, data):
        dy[0] = 2.0 * (1.0 - z[0]) - 0.3 * dz[0]

    fun = ctypes.CFUNCTYPE(*SIGNATURE)(function)
    span, times, values = truth("drone_pv_neutral")
    found = dtm.solve_dde(
        fun, span, 0.0, 0.36, neutral=True, t_eval=times, rtol=1e-9, events=lambda t, y: y[0] - 0.5
    )
    np.testing.assert_allclose(found.y, values, rtol=0, atol=1e-8)
    assert len(found.t_events[0]) == 1


def test_further_arguments_reach_function_and_events():
    def fun(t, y, z, rate):
        return -rate * z[0]

    def event(t, y, rate):
        return y[0] - 1.0 / rate

    found = dtm.solve_dde(fun, (0, 1), 1.0, 1.0, args=(2.0,), events=event)
    assert found.t_events[0] == pytest.approx([0.25], abs=1e-15)


def test_rows_may_be_numbers_and_lists():
    def fun(t, y, z):
        return [y[1], 0.0]

    found = dtm.solve_dde(fun, (0, 1), [0.0, 3.0], 1.0, vectorized=True)
    assert found.y[0, -1] == pytest.approx(3.0, abs=1e-14)


def test_an_equation_without_delays_is_an_ordinary_one():
    found = dtm.solve_dde(lambda t, y, z: -y, (0, 2), 1.0, [], vectorized=True, rtol=1e-10)
    assert found.y[0, -1] == pytest.approx(np.exp(-2.0), rel=1e-9)


def test_other_threads_run_beside_a_python_callback():
    reached = threading.Event()
    thread = threading.Thread(target=reached.set)

    def fun(t, y, z):
        if not thread.ident:
            thread.start()
        return -z[0] if reached.is_set() else 0.0 * z[0]

    # A run that keeps the other thread waiting for ever would not end.
    found = dtm.solve_dde(fun, (0, 500), 1.0, 1.0, max_step=0.1)
    thread.join()
    assert found.success


# --- output ---------------------------------------------------------------------------------


def test_dense_output_and_its_derivative():
    found = dtm.solve_dde(
        mackey_glass, (0, 100), 0.5, 17.0, vectorized=True, dense_output=True, rtol=1e-9
    )
    sol = found.sol
    assert (sol.t_min, sol.t_max) == (-17.0, 100.0)
    np.testing.assert_allclose(sol(found.t), found.y, rtol=0, atol=1e-12)
    t = np.linspace(0.1, 99.9, 700)
    np.testing.assert_allclose(
        sol(t, nu=1), mackey_glass(t, sol(t), sol(t - 17.0)[None]), rtol=0, atol=1e-6
    )
    assert sol(3.0).shape == (1,)
    assert sol([[1.0, 2.0]]).shape == (1, 1, 2)
    assert sol(-5.0) == 0.5
    for outside in (-17.1, 100.1, np.nan):
        with pytest.raises(ValueError, match="known only from"):
            sol(outside)
    with pytest.raises(ValueError, match="nu=2"):
        sol(1.0, nu=2)


def test_the_past_that_is_dropped_changes_nothing():
    kept = dtm.solve_dde(mackey_glass, (0, 200), 0.5, 17.0, vectorized=True, dense_output=True)
    dropped = dtm.solve_dde(mackey_glass, (0, 200), 0.5, 17.0, vectorized=True)
    assert np.array_equal(kept.y, dropped.y)
    assert dropped.sol is None


def test_all_nodes_are_given_by_default():
    found = dtm.solve_dde(decay, (0, 3), 1.0, 1.0)
    assert found.t[0] == 0.0
    assert found.t[-1] == 3.0
    assert np.all(np.diff(found.t) > 0)
    assert found.y.shape == (1, len(found.t))


def test_breaks_are_hit_exactly():
    found = dtm.solve_dde(decay, (0, 3.7), 1.0, 0.36, rtol=1e-9)
    np.testing.assert_allclose(found.breaks, 0.36 * np.arange(1, 11), rtol=0, atol=1e-14)
    assert set(found.breaks) <= set(found.t)


# --- history --------------------------------------------------------------------------------


def test_a_jump_inside_the_history():
    # y' = y(t - 1) with 0 before -1/3 and 3 after: constant, then slope 3 from 2/3 on.
    def history(t):
        return 3.0 * (t >= -1.0 / 3.0)

    for breaks in ((), (-1.0 / 3.0,)):
        found = dtm.solve_dde(
            grow, (0, 1), history, 1.0, history_breaks=breaks, vectorized=True, rtol=1e-10
        )
        assert found.y[0, -1] == pytest.approx(4.0, abs=1e-9)


def test_one_number_is_the_history_of_all_components():
    found = dtm.solve_dde(lambda t, y, z: -z[0], (0, 1), 2.0, 1.0, y0=[1.0, 5.0])
    assert found.y[:, -1] == pytest.approx([-1.0, 3.0], abs=1e-13)


def test_the_derivative_of_the_history_may_be_given():
    def fun(t, y, z, dz):
        return dz[0]

    given = (lambda t: 1.0, lambda t: np.cos(t))  # on purpose not its derivative
    found = dtm.solve_dde(fun, (0, 1), given, 1.0, neutral=True, rtol=1e-10)
    assert found.y[0, -1] == pytest.approx(1.0 + np.sin(1.0), abs=1e-10)
    found = dtm.solve_dde(fun, (0, 1), np.sin, 1.0, neutral=True, rtol=1e-10)
    assert found.y[0, -1] == pytest.approx(np.sin(1.0), abs=1e-9)


# --- properties -----------------------------------------------------------------------------

RTOL = 1e-8
gains = st.floats(-1.5, 1.5)


def linear(t, y, z, a, b):
    return a * y + b * z[0]


def solved(a, b, history, delay=1.0, start=0.0, scale=1.0):
    times = start + scale * np.linspace(0.0, 5.0, 11)
    found = dtm.solve_dde(
        linear,
        (times[0], times[-1]),
        history,
        delay * scale,
        args=(a / scale, b / scale),
        t_eval=times,
        rtol=RTOL,
        atol=RTOL,
        vectorized=True,
    )
    assert found.success
    return found.y[0]


def close(a, b):
    # The equation amplifies local errors by no more than it can amplify its solution.
    np.testing.assert_allclose(a, b, rtol=0, atol=50.0 * RTOL * (1.0 + np.abs(b).max()))


@given(gains, gains, st.floats(-1e3, 1e3))
def test_time_may_be_shifted(a, b, shift):
    close(solved(a, b, lambda t: np.cos(t - shift), start=shift), solved(a, b, np.cos))


@given(gains, gains, st.floats(1e-3, 1e3))
def test_time_may_be_scaled(a, b, scale):
    close(solved(a, b, lambda t: np.cos(t / scale), scale=scale), solved(a, b, np.cos))


@given(gains, gains, st.floats(-3, 3), st.floats(-3, 3))
def test_solutions_of_linear_equations_add_up(a, b, p, q):
    both = solved(a, b, lambda t: p * np.cos(t) + q * t)
    close(both, p * solved(a, b, np.cos) + q * solved(a, b, lambda t: t))


@given(st.floats(1e-4, 3.0), st.floats(-1.5, 0.0))
def test_exponentials_are_solutions(delay, s):
    # y' = s e^(s τ) y(t - τ) has the solution e^(s t) whatever the delay.
    factor = s * np.exp(s * delay)
    times = np.linspace(0.0, 4.0, 9)
    found = dtm.solve_dde(
        lambda t, y, z: factor * z[0],
        (0.0, 4.0),
        lambda t: np.exp(s * t),
        delay,
        t_eval=times,
        rtol=RTOL,
        atol=RTOL,
        vectorized=True,
    )
    close(found.y[0], np.exp(s * times))
