"""No pulse of an input, a history or the past of a solution is missed, for any elements.

Every survey draws pulses of random place, width and height; the truth is the area under the pulse,
in closed form. `DEADTIME_PULSES=1000 python -m pytest -n 0 tests/dde/test_what_is_read.py` draws a
thousand of each.
"""

import os

import deadtime as dtm
import numpy as np
import pytest

COUNT = int(os.environ.get("DEADTIME_PULSES", "25"))
INTEGRATOR = dtm.DelaySystem({0.0: 0.0}, 1.0)
LATE = dtm.DelaySystem({5.0: 1.0}, 0.0)


class Pulse:
    """A pulse between two times: a rectangle, or one that starts and ends smoothly."""

    def __init__(self, rng, low, high, is_smooth):
        # From a little above the resolution, a thousandth of the span: a smooth pulse is lost in
        # rounding next to its ends.
        self.width = (high - low) * 1.2e-3 * 80.0 ** rng.uniform()
        self.start = rng.uniform(low, high - self.width)
        self.height = 10.0 ** rng.uniform(-2.0, 4.0)
        self.end = self.start + self.width
        self.is_smooth = is_smooth
        # The integral of exp(4 - 1/(x (1 - x))) from 0 to 1, by mpmath.
        self.area = self.height * self.width * (0.3838172639958343 if is_smooth else 1.0)

    def __call__(self, t):
        x = (np.asarray(t, dtype=float) - self.start) / self.width
        inside = (x > 0.0) & (x < 1.0)
        if not self.is_smooth:
            return self.height * inside
        x = np.where(inside, x, 0.5)
        return np.where(inside, self.height * np.exp(4.0 - 1.0 / (x * (1.0 - x))), 0.0)


def pulses(low, high, seed):
    rng = np.random.default_rng(seed)
    return [Pulse(rng, low, high, is_smooth) for _ in range(COUNT) for is_smooth in (True, False)]


def attempt(run):
    """The result of a run, or the reason for its refusal."""
    try:
        return run(), ""
    except ValueError as error:
        return None, str(error)


def found_or_refused(run, truth, tolerance, option):
    """Whether a run gives the true value, or its refusal names the argument to give."""
    value, refusal = attempt(run)
    if value is None:
        assert option in refusal
        return False
    assert abs(value - truth) <= tolerance * abs(truth)
    return True


@pytest.mark.parametrize("system", [INTEGRATOR, dtm.TransferFunction([1.0], [1.0, 0.0])])
def test_no_pulse_of_an_input_is_lost(system):
    # 191 of 200 pulses of 0.5 s in 60 s were.
    found = [
        found_or_refused(
            lambda pulse=pulse: system.simulate([0.0, 60.0], pulse, vectorized=True).outputs.flat[
                -1
            ],
            pulse.area,
            1e-11,
            "input_breaks",
        )
        for pulse in pulses(0.0, 60.0, 1)
    ]
    assert np.mean(found) > 0.9


def test_no_pulse_of_a_history_of_a_system_is_lost():
    found = [
        found_or_refused(
            lambda pulse=pulse: LATE.simulate(
                [0.0, 5.0], 0.0, history=pulse, initial_state=0.0, vectorized=True
            ).outputs.flat[-1],
            pulse.area,
            1e-11,
            "history_breaks",
        )
        for pulse in pulses(-5.0, 0.0, 2)
    ]
    assert np.mean(found) > 0.9


def test_no_pulse_of_a_history_of_an_equation_is_lost():
    found = [
        found_or_refused(
            lambda pulse=pulse: dtm.solve_dde(
                lambda t, y, z: z[0], (0.0, 5.0), pulse, 5.0, y0=0.0, rtol=1e-9, vectorized=True
            ).y[0, -1],
            pulse.area,
            1e-6,
            "history_breaks",
        )
        for pulse in pulses(-5.0, 0.0, 3)
    ]
    assert np.mean(found) > 0.9


def test_no_pulse_of_the_past_of_a_system_is_lost():
    # A fast lag turns the pulse into one of the state, which comes back 5 s later.
    lag = 0.01
    system = dtm.DelaySystem(
        {0.0: [[-1.0 / lag, 0.0], [0.0, 0.0]], 5.0: [[0.0, 0.0], [1.0, 0.0]]},
        [[1.0], [0.0]],
        [[0.0, 1.0]],
    )
    for pulse in pulses(0.0, 5.0, 4):
        found_or_refused(
            lambda pulse=pulse: system.simulate(
                [0.0, 10.5], pulse, vectorized=True, max_step=5e-3
            ).outputs.flat[-1],
            lag * pulse.area,
            1e-10,
            "input_breaks",
        )


def test_no_pulse_of_the_past_of_a_solution_is_lost():
    # A dose that is gone after some milliseconds comes back 5 s later.
    rng = np.random.default_rng(5)
    for _ in range(COUNT):
        life, time = 10.0 ** rng.uniform(-5.0, -1.0), rng.uniform(1.0, 4.0)
        height = 10.0 ** rng.uniform(-2.0, 4.0)

        def dose(t, y, height=height):
            return [y[0] + height, y[1]]

        found = dtm.solve_dde(
            lambda t, y, z, life=life: [-y[0] / life, z[0, 0]],
            (0.0, 20.0),
            np.zeros(2),
            5.0,
            jumps=[(time, dose)],
            vectorized=True,
            rtol=1e-9,
        )
        assert found.success
        assert abs(found.y[1, -1] - height * life) < 1e-6 * (height * life + 1e-3)


def test_a_bump_next_to_a_break_of_the_history_is_read():
    # With 5 s to an element the nodes left 0.5 % of a bump of 1e-4 s unread.
    width = 1e-4

    def bump(t):
        return np.exp(-(((t + 2.0) / width) ** 2)) / (width * np.sqrt(np.pi))

    found = dtm.solve_dde(
        lambda t, y, z: z[0], (0, 5), bump, 5.0, y0=0.0, rtol=1e-9, history_breaks=[-2.0]
    )
    assert found.y[0, -1] == pytest.approx(1.0, abs=1e-8)


def test_what_is_shorter_than_the_resolution_is_read_where_it_is_named():
    def pulse(t):
        return 1e4 * ((t >= 4.0) & (t < 4.0001))

    def integral(**arguments):
        return INTEGRATOR.simulate([0.0, 10.0], pulse, vectorized=True, **arguments).outputs[-1]

    assert integral(input_breaks=[4.0, 4.0001]) == pytest.approx(1.0, abs=1e-10)
    assert integral(max_step=9e-5) == pytest.approx(1.0, abs=1e-10)
    with pytest.raises(ValueError, match="more than 1000000 samples"):
        integral(max_step=1e-7)
    with pytest.raises(ValueError, match="max_step"):
        integral(max_step=0.0)


def test_a_jump_is_found_where_it_is():
    # It was refused, or lost where all nodes lay on one side.
    for time in (0.3, 1.0 / 3.0, 0.999, 2.0):
        found = INTEGRATOR.simulate([0.0, 2.5], lambda t, time=time: float(t >= time))
        assert found.outputs[-1] == pytest.approx(2.5 - time, abs=1e-14)
        assert np.abs(found.breaks - time).min() < 1e-15 * time


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda t: abs(t - 0.3), r"not smooth at t = 0.3\d* s: give this time in input_breaks"),
        (lambda t: hash(t) % 1000 / 7.0, "more than 20000 polynomial pieces"),
    ],
)
def test_kinks_and_noise_are_refused_by_name(function, message):
    with pytest.raises(ValueError, match=message):
        INTEGRATOR.simulate([0.0, 1.0], function)


@pytest.mark.parametrize("omega", [1e-3, 0.1, 10.0, 1e3])
@pytest.mark.parametrize("start", [0.0, 600.0, 1e6, 1e9])
def test_sines_are_smooth_whenever_they_start(omega, start):
    # sin(10 t) over 10 s and everything at 1e9 were refused as not smooth: the rounding of t.
    for span in (0.1, 10.0, 600.0):
        phase = 6.0 * span / 600.0

        def sine(t, phase=phase):
            return np.sin(omega * t + phase)

        end = start + span
        rounding = np.finfo(float).eps * end
        value, refusal = attempt(
            lambda start=start, end=end, sine=sine: INTEGRATOR.simulate(
                [start, end], sine, vectorized=True
            ).outputs[-1]
        )
        if value is None:
            # More pieces than there may be.
            assert omega * span > 1e5
            assert "too fast" in refusal
            continue
        truth = 2.0 / omega * np.sin(0.5 * omega * (start + end) + phase)
        truth *= np.sin(0.5 * omega * span)
        assert abs(value - truth) < 1e-12 * span + 16.0 * rounding * (1.0 + omega * span)


@pytest.mark.parametrize("start", [0.0, 1e6, 1e9])
def test_a_history_of_sines_is_smooth_whenever_it_ends(start):
    found = dtm.solve_dde(
        lambda t, y, z: z[0], (start, start + 1.0), lambda t: np.sin(10.0 * t), 1.0, rtol=1e-9
    )
    truth = np.sin(10.0 * start) + 0.1 * (np.cos(10.0 * (start - 1.0)) - np.cos(10.0 * start))
    assert found.success
    assert len(found.breaks) == 0
    assert abs(found.y[0, -1] - truth) < 1e-8 + 100.0 * np.finfo(float).eps * start
