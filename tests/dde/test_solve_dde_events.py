"""Events, jumps and invalid arguments of `solve_dde`."""

import os
import signal
import threading

import deadtime as dtm
import numpy as np
import pytest


def decay(t, y, z):
    return -z[0]


def grow(t, y, z):
    return z[0]


# --- events and jumps -----------------------------------------------------------------------


def test_events_are_found_to_rounding():
    # y = 1 - t on [0, 1], then 1 - t + (t - 1)^2 / 2.
    def zero(t, y):
        return y[0] - 0.5

    found = dtm.solve_dde(decay, (0, 2), 1.0, 1.0, events=[zero, lambda t, y: t - 1.25])
    assert found.t_events[0][0] == pytest.approx(0.5, abs=4e-16)
    assert found.t_events[1][0] == pytest.approx(1.25, abs=4e-16)
    assert found.y_events[1][0, 0] == pytest.approx(-0.25 + 0.25**2 / 2, abs=1e-15)
    assert found.status == 0


def test_directions_and_terminal_events():
    def event(t, y):
        return np.sin(t)

    def times(**attributes):
        for name, value in attributes.items():
            setattr(event, name, value)
        found = dtm.solve_dde(
            decay, (0, 20), 1.0, 1.0, vectorized=True, events=event, dense_output=True
        )
        return found, found.t_events[0] / np.pi

    assert times()[1] == pytest.approx([1, 2, 3, 4, 5, 6], abs=1e-14)
    assert times(direction=1)[1] == pytest.approx([2, 4, 6], abs=1e-14)
    assert times(direction=-1)[1] == pytest.approx([1, 3, 5], abs=1e-14)
    found, crossings = times(direction=0, terminal=3)
    assert crossings == pytest.approx([1, 2, 3], abs=1e-14)
    assert found.status == 1
    assert found.t[-1] == found.sol.t_max == found.t_events[0][-1]
    assert found.y[:, -1] == pytest.approx(found.y_events[0][-1], abs=1e-14)


def test_output_ends_at_a_terminal_event():
    def event(t, y):
        return t - 1.5

    event.terminal = True
    found = dtm.solve_dde(decay, (0, 3), 1.0, 1.0, events=event, t_eval=[0.5, 1.0, 2.0])
    assert list(found.t) == [0.5, 1.0]


def test_jumps_of_the_right_hand_side():
    # The function's own test of the time agrees with the side of every node.
    def fun(t, y, z):
        return np.where(t < 1.3, 1.0, -1.0) + 0.0 * y

    found = dtm.solve_dde(fun, (0, 2), 0.0, 0.5, jumps=[1.3], vectorized=True, dense_output=True)
    assert found.y[0, -1] == pytest.approx(0.6, abs=1e-14)
    assert found.n_rejected == 0
    assert 1.3 in found.breaks
    assert found.sol(1.3, nu=1) == pytest.approx(-1.0, abs=1e-12)


def test_a_jump_at_a_breaking_point_keeps_its_own_time():
    # 0.1 + 0.1 + 0.1 is not 0.3: the time of the jump is the one that counts.
    def fun(t, y, z):
        return np.where(t < 0.3, 1.0, -1.0) + 0.0 * z[0]

    found = dtm.solve_dde(fun, (0, 1), 0.0, 0.1, y0=0.0, jumps=[0.3], vectorized=True, rtol=1e-9)
    assert found.y[0, -1] == pytest.approx(-0.4, abs=1e-14)
    assert found.n_rejected == 0
    assert 0.3 in found.breaks


def test_a_breaking_point_at_the_end_of_the_run():
    for end in (3.0, np.nextafter(3.0, 4.0), np.nextafter(3.0, 2.0), 0.1 + 0.2):
        found = dtm.solve_dde(decay, (0, end), 1.0, 0.1)
        assert found.success
        assert found.t[-1] == end


def test_jumps_of_the_solution_return_after_the_delay():
    # A dose of 1 at 0.5: y' = -y(t - 1).
    found = dtm.solve_dde(
        decay,
        (0, 2),
        0.0,
        1.0,
        jumps=[(0.5, lambda t, y: y + 1.0)],
        t_eval=[0.25, 0.5, 1.5, 2.0],
        vectorized=True,
    )
    assert found.y[0] == pytest.approx([0.0, 1.0, 1.0, 0.5], abs=1e-13)
    assert {0.5, 1.5} <= set(found.breaks)
    whole = dtm.solve_dde(decay, (0, 2), 0.0, 1.0, jumps=[(0.5, lambda t, y: y + 1.0)])
    assert list(whole.y[0, whole.t == 0.5]) == [0.0, 1.0]


# --- hostile input --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"delays": 0.0}, "use y itself"),
        ({"delays": [1.0, -1.0]}, "advanced"),
        ({"delays": np.nan}, "not above zero"),
        ({"delays": np.inf}, "infinite"),
        ({"delays": 1e-18}, "is smaller than the rounding errors"),
        ({"t_span": (1, 0)}, "later one second"),
        ({"t_span": (0, np.inf)}, "finite"),
        ({"history": np.nan}, "finite"),
        ({"history": lambda t: np.nan}, r"history is \[nan\] at t=0"),
        ({"history": lambda t: 1.0 if t > -0.5 else np.inf}, "history is inf at t=-"),
        ({"history": lambda t: [[1.0]]}, "shape"),
        ({"history": lambda t: [1.0, 2.0][: 1 + (t < 0)]}, "each of 1 components"),
        ({"history": [1.0, 2.0], "y0": 1.0}, "one number for each of 1"),
        ({"y0": np.inf}, "finite"),
        ({"method": "euler"}, "'auto', 'spectral'"),
        ({"rtol": 0.0}, "rtol=0"),
        ({"atol": -1.0}, "atol=-1"),
        ({"atol": [1.0, 2.0]}, "one for each component"),
        ({"max_step": 0.0}, "max_step"),
        ({"t_eval": [0.5, 0.25]}, "increasing times"),
        ({"t_eval": [2.0]}, "t_span"),
        ({"fun": lambda t, y, z: [1.0, 2.0]}, r"an array of shape \(2,\) at t=0"),
        ({"fun": lambda t, y, z: np.zeros((1, 3)), "vectorized": True}, r"\(1, 3\) for"),
        ({"fun": lambda t, y, z: np.full(1, np.nan)}, r"not finite at t=0"),
        ({"events": lambda t, y: [1.0, 2.0]}, "event 0 returned an array of shape"),
        ({"events": lambda t, y: np.nan}, "event 0 is nan"),
        ({"jumps": [(0.5, lambda t, y: [1.0, 2.0])]}, "change at t=0.5"),
        ({"jumps": [(0.5, lambda t, y: np.nan)]}, "returned nan"),
    ],
)
def test_bad_arguments_say_what_is_wrong(change, message):
    arguments = {"fun": decay, "t_span": (0, 1), "history": 1.0, "delays": 1.0} | change
    with pytest.raises(ValueError, match=message):
        dtm.solve_dde(**arguments)


@pytest.mark.parametrize(
    "change",
    [
        {"fun": 3.0},
        {"history": (np.cos, 3.0)},
        {"history": "constant"},
        {"events": [3.0]},
        {"jumps": [(0.5, 3.0)]},
        {"delays": ["one"]},
        {"rtol": "small"},
    ],
)
def test_wrong_types_are_refused(change):
    arguments = {"fun": decay, "t_span": (0, 1), "history": 1.0, "delays": 1.0} | change
    with pytest.raises(TypeError):
        dtm.solve_dde(**arguments)


class OwnError(Exception):
    pass


def raising(*_):
    raise OwnError("mine")


@pytest.mark.parametrize(
    "change",
    [
        {"fun": raising},
        {"fun": raising, "vectorized": True},
        {"history": lambda t: raising() if t < -0.5 else 1.0},
        {"events": raising},
        {"jumps": [(0.5, raising)]},
    ],
)
def test_exceptions_of_the_caller_come_through(change):
    arguments = {"fun": decay, "t_span": (0, 1), "history": 1.0, "delays": 1.0} | change
    with pytest.raises(OwnError, match="mine"):
        dtm.solve_dde(**arguments)


def test_a_solution_that_ends_is_given_up_to_its_end():
    with np.errstate(over="ignore"):
        found = dtm.solve_dde(lambda t, y, z: y**2, (0, 2), 1.0, 1.0, dense_output=True)
    assert not found.success
    assert found.status == -1
    assert found.t[-1] == pytest.approx(1.0, abs=1e-3)
    assert found.sol.t_max == found.t[-1]
    assert "t=0.99" in found.message or "t=1.0" in found.message


def test_a_right_hand_side_that_ends_says_where():
    def fun(t, y, z):
        with np.errstate(invalid="ignore"):
            return np.sqrt(0.75 - t) * z[0]

    found = dtm.solve_dde(fun, (0, 2), 1.0, 1.0, vectorized=True)
    assert found.status == -1
    assert found.t[-1] == pytest.approx(0.75, abs=1e-3)
    assert "0.7" in found.message


@pytest.mark.parametrize("compiled", [False, True])
def test_ctrl_c_stops_a_run(listens_to_ctrl_c, compiled):
    if compiled:
        numba = pytest.importorskip("numba")
        real, pointer = numba.types.float64, numba.types.CPointer(numba.types.float64)
        signature = numba.types.void(real, pointer, pointer, pointer, pointer, numba.types.voidptr)

        @numba.cfunc(signature)
        def fun(t, y, z, dz, dy, data):
            dy[0] = -0.5 * np.pi * z[0]

    else:

        def fun(t, y, z):
            return -0.5 * np.pi * z[0]

    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        dtm.solve_dde(
            fun, (0, 1e9), 1.0, 1.0, t_eval=[1e9], vectorized=not compiled, max_steps=None
        )
    timer.join()
