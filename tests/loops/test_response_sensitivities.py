"""Derivatives of responses against closed forms, superposition and extrapolated differences."""

import math

import deadtime as dtm
import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from loops import loops

TIMES = np.linspace(0.0, 5.0, 101)


def p_terms(kp, delay, times):
    """y = sum_j -(-kp)^j (t - j delay)_+^j / j!, for complex numbers as well."""
    total = np.zeros(len(times), dtype=complex)
    for j in range(1, 40):
        since = times - j * delay
        total -= np.where(since.real > 0.0, (-kp * since) ** j / math.factorial(j), 0.0)
    return total


def pv_terms(kp, kv, delay, times):
    """The geometric series of kp e^(-s T)/(s (s + (kp + kv s) e^(-s T))), term by term."""
    total = np.zeros(len(times), dtype=complex)
    for j in range(40):
        since = times - (j + 1) * delay
        for i in range(j + 1):
            power = j + 1 - i
            term = (
                kp * (-1) ** j * math.comb(j, i) * kp ** (j - i) * kv**i
                * since**power / math.factorial(power)
            )  # fmt: skip
            total += np.where(since.real > 0.0, term, 0.0)
    return total


def test_p_loop_against_its_closed_form():
    kp, delay = 1.31, 0.36
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(kp), delay=delay)
    found = loop.simulate(TIMES, sensitivities=("delay", "Kp")).sensitivities
    step = 1e-30j
    # Terms up to e^(kp t) = 700 cancel in the closed form.
    np.testing.assert_allclose(
        found["delay"], p_terms(kp, delay + step, TIMES).imag / 1e-30, atol=1e-12
    )
    np.testing.assert_allclose(
        found["Kp"], p_terms(kp + step, delay, TIMES).imag / 1e-30, atol=1e-12
    )


def test_neutral_loop_whose_jumps_travel_on():
    numbers = {"Kp": 1.2, "Kv": 0.4, "delay": 0.36}
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.2, 0.4), delay=0.36)
    found = loop.simulate(TIMES, sensitivities=tuple(numbers)).sensitivities
    for name in numbers:
        stepped = numbers | {name: numbers[name] + 1e-30j}
        truth = pv_terms(stepped["Kp"], stepped["Kv"], stepped["delay"], TIMES).imag / 1e-30
        np.testing.assert_allclose(found[name], truth, atol=1e-11, err_msg=name)


def test_the_gain_of_a_linear_loop_and_the_height_of_its_step_have_the_same_effect():
    loop = dtm.ControlLoop(dtm.FirstOrder(2.0, 0.5), dtm.P(1.3), delay=0.2)
    found = loop.simulate(TIMES, sensitivities=("gain", "Kp"))
    # y depends on gain * Kp alone.
    np.testing.assert_allclose(
        2.0 * found.sensitivities["gain"], 1.3 * found.sensitivities["Kp"], atol=1e-13
    )


@pytest.mark.parametrize("controller", [dtm.PV(1.0, 0.4), dtm.PI(1.0, 0.4), dtm.PD(1.0, 0.2)])
def test_jumps_that_coincide_but_move_differently_are_separate(controller):
    # The second step comes just when the first one comes back, for this delay only.
    delay = 0.25
    loop = dtm.ControlLoop(dtm.Integrator(), controller, delay=delay)
    later = 2.0 * delay
    both = loop.simulate(
        TIMES, [1.0, 0.2], reference_time=[0.0, later], sensitivities=("delay",)
    ).sensitivities["delay"]
    first = loop.simulate(TIMES, 1.0, sensitivities=("delay",)).sensitivities["delay"]
    times = np.concatenate([[0.0], TIMES[later < TIMES] - later])
    second = loop.simulate(times, -0.8, sensitivities=("delay",)).sensitivities["delay"]
    apart = later + 1e-9 < TIMES
    # At output times on a jump of the derivative, its side is a matter of rounding.
    clear = np.abs((TIMES[apart] / delay) % 1.0 - 0.5) < 0.45
    np.testing.assert_allclose(both[apart][clear], (first[apart] + second[1:])[clear], atol=1e-12)


def test_a_jump_takes_the_derivative_of_what_follows():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.5)
    found = loop.simulate([0.0, 0.25, 0.5, 0.75], sensitivities=("delay",))
    np.testing.assert_allclose(found.sensitivities["delay"], [0.0, 0.0, -1.0, -1.0], atol=1e-15)


def test_a_delay_in_the_measurement_moves_the_output_times():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.31), delay=0.36)
    ahead = loop.replace(delay_path="measurement").simulate(TIMES, sensitivities=("delay", "Kp"))
    times = np.concatenate([[0.0], TIMES + 0.36])
    behind = loop.simulate(times, sensitivities=("delay", "Kp"))
    undelayed = loop.simulate(TIMES).outputs
    np.testing.assert_allclose(ahead.outputs, behind.outputs[1:], atol=1e-15)
    # y'(t + delay) = w(t + delay) = kp (1 - y(t)).
    slope = 1.31 * (1.0 - undelayed)
    np.testing.assert_allclose(
        ahead.sensitivities["delay"], behind.sensitivities["delay"][1:] + slope, atol=1e-13
    )
    np.testing.assert_allclose(
        ahead.sensitivities["Kp"], behind.sensitivities["Kp"][1:], atol=1e-13
    )


def differences(loop, name, times, step, **start):
    """Central differences, extrapolated twice: error of sixth order in the step."""

    def central(h):
        value = loop.parameters[name]
        above = loop.replace(**{name: value + h}).simulate(times, **start)
        below = loop.replace(**{name: value - h}).simulate(times, **start)
        return (above.outputs - below.outputs) / (2.0 * h)

    rough, fine, finest = (central(step / 2.0**i) for i in range(3))
    first, second = (4.0 * fine - rough) / 3.0, (4.0 * finest - fine) / 3.0
    return (16.0 * second - first) / 15.0


def clear_of_breaks(response, distance):
    """Output times farther than that from all breaks."""
    apart = np.abs(response.time[:, None] - response.breaks[None, :])
    return np.all(apart > distance * (1.0 + response.time[:, None]), axis=1)


CASES = [
    dtm.ControlLoop(dtm.Integrator(), dtm.P(1.31), delay=0.36, limit=0.5),
    dtm.ControlLoop(
        dtm.Integrator(), dtm.PV(2.0, 0.3, dtm.DerivativeFilter(38.0)), delay=0.36, limit=1.0
    ),
    dtm.ControlLoop(dtm.Integrator(0.9, 0.2), dtm.PI(0.8, 0.2), delay=0.21),
    dtm.ControlLoop(dtm.FirstOrder(2.0, 0.5), dtm.PI(0.8, 0.6), delay=0.1, limit=0.6),
    dtm.ControlLoop(dtm.kit_plant(), dtm.PD(1.0, 0.1), delay=0.3),
    dtm.ControlLoop(dtm.Integrator(), dtm.P(1.31), delay=0.36, sample_time=0.065, limit=0.5),
    dtm.ControlLoop(dtm.Integrator(1.1, 0.2), dtm.PV(2.0, 0.3), delay=0.17, sample_time=0.1),
    dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.3), delay=0.0, limit=1.0),
]


@pytest.mark.parametrize("loop", CASES, ids=range(len(CASES)))
def test_every_number_of_a_loop_against_differences(loop):
    names = [
        name
        for name, value in loop.parameters.items()
        if not (name in ("lag", "delay") and value == 0.0)
    ]
    times = np.linspace(0.0, 4.0, 117)
    response = loop.simulate(times, 2.0, sensitivities=names)
    clear = clear_of_breaks(response, 2e-3)
    assert np.count_nonzero(clear) > 20
    for name in names:
        step = 4e-4 * loop.parameters[name]
        truth = differences(loop, name, times, step, reference=2.0)
        size = 1.0 + np.max(np.abs(truth))
        # Rounding of the outputs over the smallest step.
        np.testing.assert_allclose(
            response.sensitivities[name][clear] / size,
            truth[clear] / size,
            atol=5e-10,
            err_msg=name,
        )


def stretches_at_the_limit(loop):
    """Which samples are limited, or how often a continuous command reaches its limit."""
    if loop.limit is None:
        return 0
    if loop.sample_time is None:
        limited = np.abs(loop.simulate(np.linspace(0.0, 2.0, 2001)).inputs) >= loop.limit
        return int(np.count_nonzero(np.diff(limited)))
    samples = (np.arange(int(2.0 / loop.sample_time)) + 0.5) * loop.sample_time
    response = loop.simulate(np.concatenate([[0.0], samples]))
    return (np.abs(response.inputs) >= loop.limit).tolist()


@settings(max_examples=60, deadline=None)
@given(loop=loops(st.sampled_from([None, 0.7])), data=st.data())
def test_random_loops_against_differences(loop, data):
    names = [name for name, value in loop.parameters.items() if value != 0.0]
    name = data.draw(st.sampled_from(names))
    times = np.linspace(0.0, 2.0, 53)
    # Whole samples in the delay, where only one side has this derivative, apart.
    if loop.sample_time is not None:
        ratio = loop.delay / loop.sample_time
        assume(abs(ratio - round(ratio)) > 1e-2 or name not in ("delay", "sample_time"))
    try:
        response = loop.simulate(times, sensitivities=(name,))
    except ValueError as error:
        assert "delay" in str(error) or "exceeds" in str(error)  # noqa: PT017
        return
    assume(np.max(np.abs(response.outputs)) < 1e2)
    clear = clear_of_breaks(response, 2e-3)
    step = 2e-4 * abs(loop.parameters[name])
    truth = differences(loop, name, times, step)
    # Where a command just meets its limit, the response has a kink over its numbers.
    around = [loop.parameters[name] + part * step for part in (-1.0, 0.0, 1.0)]
    kinds = [stretches_at_the_limit(loop.replace(**{name: value})) for value in around]
    assume(kinds[0] == kinds[1] == kinds[2])
    size = (
        1.0 + np.max(np.abs(truth)) + np.max(np.abs(response.outputs)) / abs(loop.parameters[name])
    )
    found = response.sensitivities[name]
    np.testing.assert_allclose(found[clear] / size, truth[clear] / size, atol=1e-8)


def test_the_start_depends_on_the_numbers_too():
    # At rest at 1, FirstOrder needs a command of 1/gain; the integral of PI holds it.
    loop = dtm.ControlLoop(dtm.FirstOrder(2.0, 0.5), dtm.PI(0.8, 0.6), delay=0.1)
    times = np.linspace(0.0, 3.0, 97)
    start = {"reference": 0.3, "initial_output": 1.0}
    names = ("gain", "time_constant", "Ki", "delay")
    response = loop.simulate(times, sensitivities=names, **start)
    clear = clear_of_breaks(response, 2e-3)
    for name in names:
        truth = differences(loop, name, times, 4e-4 * loop.parameters[name], **start)
        np.testing.assert_allclose(
            response.sensitivities[name][clear], truth[clear], atol=1e-10, err_msg=name
        )


def test_the_command_has_derivatives_as_well():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.31), delay=0.36)
    found = loop.simulate(TIMES, sensitivities=("delay", "Kp"))
    np.testing.assert_allclose(
        found.input_sensitivities["delay"], -1.31 * found.sensitivities["delay"], atol=1e-14
    )
    np.testing.assert_allclose(
        found.input_sensitivities["Kp"],
        1.0 - found.outputs - 1.31 * found.sensitivities["Kp"],
        atol=1e-14,
    )


def test_outputs_do_not_depend_on_whether_derivatives_are_asked_for():
    loop = CASES[1]
    plain, with_slopes = loop.simulate(TIMES), loop.simulate(TIMES, sensitivities=("delay",))
    assert np.array_equal(plain.outputs, with_slopes.outputs)
    assert plain.sensitivities == {}
    assert not with_slopes.sensitivities["delay"].flags.writeable


@pytest.mark.parametrize(
    ("names", "error", "words"),
    [
        (("mass",), ValueError, "no parameter 'mass'"),
        ("delay", TypeError, "sequence"),
        (("lag",), ValueError, "lag=0"),
    ],
)
def test_what_has_no_derivative_is_refused(names, error, words):
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.3)
    with pytest.raises(error, match=words):
        loop.simulate([0.0, 1.0], sensitivities=names)


def test_a_delay_of_zero_has_no_derivative():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.0)
    with pytest.raises(ValueError, match="delay=0"):
        loop.simulate([0.0, 1.0], sensitivities=("delay",))


def limited_loops(count):
    """Loops in continuous time with a limited rate, whose commands turn and leave their bounds."""
    rng = np.random.default_rng(20261130)
    for _ in range(count):
        plant = rng.choice([0, 1])
        gain, lag = rng.uniform(0.5, 2.0), rng.uniform(0.2, 2.0)
        yield dtm.ControlLoop(
            dtm.Integrator(gain) if plant else dtm.FirstOrder(gain, lag),
            dtm.P(rng.uniform(1.0, 8.0)) if rng.random() < 0.5 else dtm.PI(rng.uniform(1, 5), 0.7),
            delay=rng.choice([0.05, 0.25, 0.5]),
            rate_limit=rng.uniform(0.5, 20.0),
            limit=None if rng.random() < 0.5 else rng.uniform(0.8, 2.0),
        )


@pytest.mark.parametrize("count", [30, pytest.param(300, marks=pytest.mark.survey)])
def test_limited_rates_that_take_over_at_once_move_with_the_numbers(count):
    """Against quotients to both sides, where these agree."""
    time = np.array([0.0, 0.6, 1.1, 1.6, 1.83, 2.0, 3.0])
    given = {"reference": [1.0, 3.0, -1.0], "reference_time": [0.0, 1.0, 2.0]}
    compared = 0
    for loop in limited_loops(count):
        names = tuple(
            name for name in ("Kp", "delay", "rate_limit", "limit") if name in loop.parameters
        )
        found = loop.simulate(time, sensitivities=names, **given)
        size = max(1.0, float(np.abs(found.outputs).max()))
        for name in names:
            value = loop.parameters[name]
            sides = [
                (
                    loop.replace(**{name: value * (1.0 + step)}).simulate(time, **given).outputs
                    - found.outputs
                )
                / (value * step)
                for step in (1e-6, -1e-6)
            ]
            alike = np.abs(sides[0] - sides[1]) < 1e-3 * size
            mean = 0.5 * (sides[0] + sides[1])
            scale = size + np.abs(mean)
            assert (np.abs(found.sensitivities[name] - mean) < 2e-3 * scale)[alike].all(), (
                loop,
                name,
            )
            compared += int(alike.sum())
    assert compared > 10 * count


@pytest.mark.parametrize("rate_limit", [0.5, 100.0])
def test_a_limited_rate_hides_no_break(rate_limit):
    time = np.linspace(0.0, 12.0, 25)
    slow = dtm.ControlLoop(
        dtm.FirstOrder(1.0, 1.0), dtm.PI(1.0, 0.5, weight=0.0), delay=0.1, rate_limit=rate_limit
    )
    run = slow.simulate(time, [1.0, 3.0], reference_time=[0.0, 8.0])
    assert {8.0, 8.1} <= set(run.breaks.round(9))
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.1, rate_limit=rate_limit)
    assert {8.0, 8.1} <= set(loop.simulate(time, 1.0, load=([8.0], [0.5])).breaks.round(9))


@pytest.mark.parametrize("tracking", [0.3, None])
def test_the_delay_moves_two_jumps_that_meet_apart(tracking):
    """The reference jumps where the answer to its first jump arrives: one of both derivatives."""
    time = np.r_[0.0, np.arange(0.013, 1.5, 0.036)]
    given = {"reference_time": [0.0, 0.25]}
    windup = {} if tracking is None else {"anti_windup": tracking}
    for kv, level in ((0.3, 2.0), (0.5, -1.0), (0.6, 0.5)):
        loop = dtm.ControlLoop(
            dtm.Integrator(), dtm.PID(1.0, 0.3, kv, derivative_weight=0.0, **windup),
            delay=0.25, limit=0.6,
        )  # fmt: skip
        found = loop.simulate(time, [1.0, level], sensitivities=("delay",), **given)
        sides = []
        for step in (1e-8, -1e-8):
            moved = loop.replace(delay=0.25 + step).simulate(time, [1.0, level], **given)
            sides.append((moved.outputs - found.outputs) / step)
        off = [float(np.abs(found.sensitivities["delay"] - side).max()) for side in sides]
        assert min(off) < 1e-4
