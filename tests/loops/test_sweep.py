"""Sweeps against one simulation per set, and the status, shapes and bits of their results."""

import os
import subprocess
import sys

import deadtime as dtm
import numpy as np
import pytest
import scipy.linalg
from hypothesis import assume, given, settings, strategies as st
from loops import loops

DRONE = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.3), delay=0.36, sample_time=0.065, limit=1.0)
FINE = np.linspace(0.0, 10.0, 4001)


def random_values(loop, count, seed=0):
    """Numbers around those of a loop."""
    rng = np.random.default_rng(seed)
    return {
        name: value * rng.uniform(0.7, 1.3, count)
        for name, value in loop.parameters.items()
        if value != 0.0
    }


def single(loop, values, i):
    return loop.replace(**{name: float(array[i]) for name, array in values.items()})


LOOPS = [
    DRONE,
    DRONE.replace(limit=None, delay=0.13, sample_time=0.1),
    DRONE.replace(controller=dtm.PV(1.3, 0.2)),
    DRONE.replace(controller=dtm.PV(1.3, 0.2, dtm.DerivativeFilter(38.0))),
    DRONE.replace(controller=dtm.PI(0.8, 0.1), delay_path="measurement"),
    DRONE.replace(controller=dtm.PID(0.8, 0.1, 0.1, dtm.DerivativeFilter(15.0)), delay=0.2),
    DRONE.replace(plant=dtm.Integrator(1.0, 0.2), delay=0.1),
    DRONE.replace(plant=dtm.FirstOrder(2.0, 0.5), controller=dtm.PI(0.4, 0.6)),
    DRONE.replace(plant=dtm.RationalPlant([0.1, 1.0], [0.5, 1.0]), delay_path="measurement"),
    DRONE.replace(plant=dtm.FactoredPlant([0.2, 0.1]), controller=dtm.PI(0.4, 1.0)),
    DRONE.replace(
        plant=dtm.FactoredPlant(pole_frequency=4.0, pole_damping=0.6), controller=dtm.PI(0.1, 1.0)
    ),
    DRONE.replace(
        plant=dtm.Integrator(1.0, 0.2),
        controller=dtm.PV(1.3, 0.2, dtm.DerivativeFilter(38.0)),
        delay=0.13,
    ),
    DRONE.replace(plant=dtm.FactoredPlant([0.3, 0.1], integrator=True), delay=0.195),
    DRONE.replace(plant=dtm.Integrator(1.0, 0.004), sample_time=0.2),
    dtm.ControlLoop(dtm.Integrator(), dtm.P(1.3), delay=0.36),
    dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.3, 0.3), delay=0.36, delay_path="measurement"),
    dtm.ControlLoop(
        dtm.Integrator(), dtm.PV(1.3, 0.2, dtm.DerivativeFilter(38.0)), delay=0.3, limit=0.7
    ),
    dtm.ControlLoop(dtm.kit_plant(), dtm.PI(0.8, 0.1), delay=0.2),
    dtm.ControlLoop(dtm.Integrator(1.0, 0.3), dtm.P(1.3), delay=0.0, limit=0.8),
    dtm.ControlLoop(dtm.Integrator(), dtm.P(1.3), delay=0.36, limit=0.6),
    dtm.ControlLoop(
        dtm.Integrator(1.0, 0.2), dtm.P(1.6), delay=0.2, limit=0.5, delay_path="measurement"
    ),
    dtm.ControlLoop(dtm.FirstOrder(2.0, 0.5), dtm.PI(0.4, 0.6), delay=0.3, limit=0.3),
]


@pytest.mark.parametrize("loop", LOOPS, ids=range(len(LOOPS)))
def test_responses_are_those_of_single_simulations(loop):
    values = random_values(loop, 37)
    times = np.linspace(0.5, 6.5, 61)
    found = dtm.sweep(loop, values, times, responses=True, amplitude=-0.8)
    assert found.outputs.shape == (37, 61)
    assert not found.status.any()
    for i in range(0, 37, 5):
        one = single(loop, values, i).step_response(times, amplitude=-0.8)
        np.testing.assert_allclose(found.outputs[i], one.outputs, rtol=0, atol=2e-13)


@pytest.mark.parametrize("loop", LOOPS, ids=range(len(LOOPS)))
def test_metrics_are_those_of_single_responses(loop):
    values = random_values(loop, 20, seed=1)
    found = dtm.sweep(loop, values, 10.0, amplitude=-0.8)
    for i in range(0, 20, 4):
        one = single(loop, values, i)
        response = one.step_response(FINE, amplitude=-0.8)
        info = response.info()
        if found.status[i] == dtm.loops.SweepStatus.UNSETTLED and not np.isnan(
            info["settling_time"]
        ):
            # Three of the slowest time constants have not passed since the band was entered.
            rightmost = one.replace(limit=None).rightmost()
            slowest = -1.0 / np.real(np.asarray(rightmost)).max()
            assert 10.0 - info["settling_time"] < 3.0 * slowest
            info["settling_time"] = np.nan
        # `info` magnifies to 1e-8 of the output step; the range begins at its own output times.
        for name in ("rise_time", "settling_time", "overshoot", "undershoot", "peak"):
            np.testing.assert_allclose(
                found[name][i], info[name], atol=1e-7, err_msg=f"{name} of set {i}"
            )
        assert found["steady_state"][i] == pytest.approx(info["steady_state"], abs=1e-12)
        # On one side of it, where the output jumps.
        around = found["peak_time"][i] + np.array([-1e-10, 0.0, 1e-10])
        at_peak = np.abs(response._dense(np.clip(around, 0.0, 10.0))).max()
        assert at_peak == pytest.approx(info["peak"], abs=1e-8)
        for name in ("settling_min", "settling_max"):
            np.testing.assert_allclose(found[name][i], info[name], atol=2e-2)


def stepped(loop, time):
    """Outputs on a fine grid: matrix exponentials from one of its times to the next."""
    numbers = loop.parameters
    num, den = (np.trim_zeros(part, "f") for part in loop.plant._polynomials(numbers))
    lead, order = den[0], len(den) - 1
    A = np.zeros((order + 1, order + 1))
    A[: order - 1, 1:order] = np.eye(order - 1)
    A[order - 1, :order] = -np.asarray(den[:0:-1]) / lead
    A[order - 1, order] = 1.0 / lead
    C = np.zeros(order)
    C[: len(num)] = num[::-1]
    step = time[1]
    hold = scipy.linalg.expm(A * step)[:order, : order + 1]
    half = scipy.linalg.expm(A * (step / 2))[:order, : order + 1]
    every, late = (round(t / step) for t in (loop.sample_time, loop.delay))
    integral, state, commands, found = 0.0, np.zeros(order), [], []
    kp, ki = numbers["Kp"], numbers.get("Ki", 0.0)
    for i in range(len(time)):
        y = C @ state
        found.append(y)
        if i % every == 0:
            u = np.clip(kp * (1.0 - y) + ki * integral, -loop.limit, loop.limit)
        commands.append(u)
        # The integral of the error, by Simpson's rule over the step.
        w = commands[i - late] if i >= late else 0.0
        middle = C @ (half[:, :order] @ state + half[:, order] * w)
        state = hold[:, :order] @ state + hold[:, order] * w
        integral += step * (1.0 - (y + 4.0 * middle + C @ state) / 6.0)
    return np.array(found)


@pytest.mark.parametrize("controller", [dtm.P(1.6), dtm.PI(0.9, 0.4)])
@pytest.mark.parametrize(
    "plant",
    [
        dtm.Integrator(),
        dtm.Integrator(1.0, 0.2),
        dtm.FirstOrder(1.5, 0.4),
        dtm.FactoredPlant([0.3, 0.15]),
        dtm.FactoredPlant(pole_frequency=3.0, pole_damping=0.4),
        dtm.FactoredPlant([0.3, 0.1], integrator=True),
    ],
)
def test_metrics_are_those_of_matrix_exponentials(plant, controller):
    # A delay of 4.4 samples, all on one grid of a hundredth of a sample.
    loop = dtm.ControlLoop(plant, controller, delay=0.22, sample_time=0.05, limit=1.1)
    step = 0.05 / 100
    time = step * np.arange(12_001)
    y = stepped(loop, time)
    found = dtm.sweep(loop, {"Kp": [loop.parameters["Kp"]]}, 6.0)
    top = int(np.argmax(np.abs(y)))
    # The peak lies between two times of the grid, and the output is flat there.
    assert found["peak"][0] == pytest.approx(np.abs(y).max(), abs=2e-5)
    assert found["peak"][0] >= np.abs(y).max() - 1e-9
    assert found["peak_time"][0] == pytest.approx(time[top], abs=2 * step)
    steady = found["steady_state"][0]
    outside = np.flatnonzero(np.abs(y - steady) > 0.02 * abs(steady))
    if found.status[0] == dtm.loops.SweepStatus.OK:
        assert time[outside[-1]] <= found["settling_time"][0] <= time[outside[-1] + 1]
    reached = [np.flatnonzero(y >= part * steady) for part in (0.1, 0.9)]
    if reached[1].size:
        first, last = (time[places[0]] for places in reached)
        assert found["rise_time"][0] == pytest.approx(last - first, abs=2 * step)
    else:
        assert np.isnan(found["rise_time"][0])


def test_a_p_loop_has_the_overshoot_of_the_closed_form():
    # kp delay - 1/2 from kp delay = 1 on.
    gains, delays = np.ix_([2.5, 2.8, 3.0], [0.4, 0.45])
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0))
    found = dtm.sweep(loop, {"Kp": gains, "delay": delays}, 4.0)
    assert found.shape == (3, 2)
    np.testing.assert_allclose(found["overshoot"], 100.0 * (gains * delays - 0.5), rtol=1e-13)
    # y' = 0 where kp (t - delay) = 1, one delay earlier.
    np.testing.assert_allclose(found["peak_time"], 1.0 / gains + 2.0 * delays, rtol=1e-13)


def test_arrays_broadcast_and_keep_their_shape():
    found = dtm.sweep(DRONE, {"Kp": [[1.0], [2.0]], "delay": np.array([0.1, 0.2, 0.3])}, 8.0)
    assert found["overshoot"].shape == found.status.shape == (2, 3)
    lone = dtm.sweep(DRONE, {"Kp": 2.0, "delay": 0.2}, 8.0)
    assert lone.shape == ()
    assert lone["overshoot"] == found["overshoot"][1, 1]
    outputs = dtm.sweep(DRONE, {"Kp": [[1.0], [2.0]]}, [0.0, 1.0], responses=True).outputs
    assert outputs.shape == (2, 1, 2)
    grid = dtm.sweep(DRONE, {"Kp": (1, 2, 3), "delay": (0.1, 0.3, 5), "gain": [0.9]}, 8.0)
    assert grid.shape == (3, 5, 1)
    assert (
        grid["overshoot"][2, 1, 0]
        == dtm.sweep(DRONE, {"Kp": 2.0, "delay": 0.1 + 0.05, "gain": 0.9}, 8.0)["overshoot"]
    )
    nothing = dtm.sweep(DRONE, {"Kp": []}, 8.0)
    assert nothing["overshoot"].shape == (0,)
    with pytest.raises(ValueError, match="do not broadcast"):
        dtm.sweep(DRONE, {"Kp": np.array([1.0, 2.0]), "delay": np.array([0.1, 0.2, 0.3])}, 8.0)


#: Values of each number that may vary.
VARIED = {
    "limit": [0.002, 0.01, 0.5],
    "Kp": [0.5, 1.0, 2.0],
    "Ki": [0.1, 0.2, 0.3],
    "delay": [0.1, 0.2, 0.3],
    "sample_time": [0.05, 0.1, 0.2],
    "gain": [0.5, 1.0, 1.5],
    "lag": [0.0, 0.1, 0.2],
}


@pytest.mark.parametrize("time", [None, 10.0])
@pytest.mark.parametrize("limit", [None, 1.0])
@pytest.mark.parametrize("sample_time", [None, 0.05])
def test_every_number_varies_in_any_form(sample_time, limit, time):
    # Three limits of a sampled loop ended in an IndexError.
    loop = dtm.ControlLoop(
        dtm.Integrator(), dtm.PI(1.0, 0.2), delay=0.3, sample_time=sample_time, limit=limit
    )
    for name, values in VARIED.items():
        array = np.array(values)
        each = [dtm.sweep(loop, {name: value}, time) for value in values]
        for form in (array, array.reshape(3, 1), values * 2, array[:0], array[1:2]):
            found = dtm.sweep(loop, {name: form}, time)
            assert found.shape == found.status.shape == np.shape(form)
            for one, settled in zip(np.ravel(form), found["settling_time"].flat, strict=True):
                alone = each[values.index(one)]["settling_time"]
                np.testing.assert_equal(settled, alone, err_msg=f"{name}={one}")
        other = "Kp" if name != "Kp" else "limit"
        grid = dtm.sweep(loop, {name: array[:, None], other: np.array(VARIED[other])}, time)
        assert grid["settling_time"].shape == (3, 3)


def test_a_lag_of_none_among_others_makes_loops_of_another_order():
    lags = np.array([0.0, 0.2, 0.0, 0.1])
    found = dtm.sweep(
        DRONE, {"lag": lags, "Kp": [1.0, 1.0, 2.0, 2.0]}, [0.0, 1.0, 2.0], responses=True
    )
    for i, (lag, kp) in enumerate(zip(lags, [1.0, 1.0, 2.0, 2.0], strict=True)):
        plant = dtm.Integrator(1.0, lag)
        one = DRONE.replace(plant=plant, Kp=kp).simulate([0.0, 1.0, 2.0])
        np.testing.assert_allclose(found.outputs[i], one.outputs, atol=1e-14)


def test_what_grows_without_bound_says_so():
    free = DRONE.replace(limit=None)
    found = dtm.sweep(free, {"Kp": np.array([1.0, 30.0, 1e3])}, 20.0)
    assert found.status.tolist() == [
        dtm.loops.SweepStatus.OK,
        dtm.loops.SweepStatus.UNSETTLED,
        dtm.loops.SweepStatus.UNSETTLED,
    ]
    found = dtm.sweep(free, {"Kp": np.array([1.0, 30.0, 1e3])}, 400.0)
    assert found.status[2] == dtm.loops.SweepStatus.DIVERGED
    assert all(np.isnan(column[2]) for column in found.metrics.values())
    assert not any(np.isnan(column[0]) for column in found.metrics.values())
    outputs = dtm.sweep(free, {"Kp": np.array([1.0, 1e3])}, [0.0, 400.0], responses=True)
    assert np.isnan(outputs.outputs[1]).all()
    assert outputs.status.tolist() == [0, dtm.loops.SweepStatus.DIVERGED]
    # The same beyond the lanes.
    lagging = free.replace(plant=dtm.Integrator(1.0, 0.1))
    assert dtm.sweep(lagging, {"Kp": np.array([1.0, 1e3])}, 400.0).status.tolist() == [0, 2]


def test_a_command_beyond_all_limits_diverges_wherever_its_run_ends():
    # 20 whole samples, a run that ends inside one, and neighbours of which one ends earlier.
    sample_times = np.array([0.5, 0.065, 0.4])
    for place in (slice(0, 1), slice(1, 2), slice(None)):
        times = sample_times[place]
        found = dtm.sweep(DRONE, {"Kp": np.full(len(times), 1e160), "sample_time": times}, 10.0)
        assert (found.status == dtm.loops.SweepStatus.DIVERGED).all()
    smooth = DRONE.replace(sample_time=None, limit=None)
    found = dtm.sweep(smooth, {"Kp": np.array([1e160]), "gain": np.array([1e-160])}, 10.0)
    assert found.status[0] == dtm.loops.SweepStatus.DIVERGED
    with pytest.raises(ValueError, match="exceeds 1e150"):
        smooth.replace(Kp=1e160, gain=1e-160).simulate([0.0, 1.0])


@pytest.mark.parametrize("lags", [[0.3], [0.3, 0.1, 0.1, 0.1, 0.1]])
@pytest.mark.parametrize("delay", [0.1, 3 * 0.05, 0.12])
def test_a_jump_at_the_end_of_a_run_counts(lags, delay):
    # The output jumps as soon as the first command arrives. With five states, loops run alone.
    numerator = [0.4 * lags[0], 1.0]
    for lag in lags[1:]:
        numerator = np.polymul(numerator, [0.5 * lag, 1.0])
    denominator = np.array([1.0])
    for lag in lags:
        denominator = np.polymul(denominator, [lag, 1.0])
    plant = dtm.RationalPlant(list(numerator), list(denominator))
    loop = dtm.ControlLoop(plant, dtm.P(0.5), delay=delay, sample_time=0.05)
    end = round(delay, 2)
    found = dtm.sweep(loop, {"Kp": [0.5]}, end)
    jump = loop.step_response([0.0, end]).outputs[-1]
    assert found["peak"][0] == jump > 0.0
    assert found["peak_time"][0] == pytest.approx(end, abs=1e-12)


def test_endless_work_is_refused_for_its_set_alone():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0))
    found = dtm.sweep(loop, {"delay": np.array([0.3, 1e-8])}, 10.0)
    assert found.status.tolist() == [0, dtm.loops.SweepStatus.REFUSED]
    assert np.isnan(found["overshoot"][1])


def bits(found):
    return {name: column.tobytes() for name, column in found.metrics.items()}


@pytest.mark.parametrize(
    "loop", [LOOPS[i] for i in (0, 5, 6, 11, 14, 16, 17, 20)], ids=(0, 5, 6, 11, 14, 16, 17, 20)
)
def test_a_set_has_its_own_bits(loop):
    values = random_values(loop, 50, seed=3)
    whole = dtm.sweep(loop, values, 6.0, threads=1)
    assert bits(whole) == bits(dtm.sweep(loop, values, 6.0, threads=3))
    order = np.random.default_rng(0).permutation(50)[:13]
    part = dtm.sweep(loop, {name: array[order] for name, array in values.items()}, 6.0)
    for name, column in part.metrics.items():
        assert column.tobytes() == whole[name][order].tobytes()


SCRIPT = """
import numpy as np, deadtime as dtm
loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.3, 0.2, dtm.DerivativeFilter(8.0)),
                       sample_time=0.065, limit=0.9)
found = dtm.sweep(loop, {"Kp": np.linspace(0.5, 2.5, 40), "delay": np.linspace(0.1, 0.5, 40)}, 9.0)
outputs = dtm.sweep(loop, {"delay": np.linspace(0.1, 0.5, 9)}, [0.0, 1.0, 3.3], responses=True)
loop = loop.replace(sample_time=None, limit=None)
smooth = dtm.sweep(loop, {"Kp": np.linspace(0.5, 2.5, 40), "delay": np.linspace(0.1, 0.5, 40)}, 9.0)
bound = loop.replace(controller=dtm.P(1.0), limit=0.8)
bound = dtm.sweep(bound, {"Kp": np.linspace(0.5, 2.5, 40), "delay": np.linspace(0.1, 0.5, 40)}, 9.0)
columns = [*found.metrics.values(), *smooth.metrics.values(), *bound.metrics.values()]
columns += [smooth.status, bound.status, outputs.outputs]
print([c.tobytes().hex() for c in columns])
"""


def test_instruction_sets_agree_to_the_bit():
    def run(name):
        return subprocess.run(
            [sys.executable, "-c", SCRIPT],
            env=os.environ | {"DEADTIME_INSTRUCTIONS": name},
            capture_output=True,
            check=True,
        ).stdout

    assert run("plain") == run("avx2") == run("avx512")


@pytest.mark.parametrize(
    "loop",
    [
        dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.3),
        dtm.ControlLoop(dtm.Integrator(1.0, 0.2), dtm.P(1.0), delay=0.3),
        dtm.ControlLoop(dtm.Integrator(), dtm.PI(1.0, 0.1), delay=0.3),
        dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.0, 0.3), delay=0.3),
        dtm.ControlLoop(dtm.FirstOrder(2.0, 0.5), dtm.PI(1.0, 0.3), delay=0.3),
        dtm.ControlLoop(dtm.FactoredPlant([0.2, 0.1]), dtm.PI(1.0, 0.8), delay=0.3),
    ],
)
def test_sets_stay_settled_where_their_slowest_root_says_so(loop):
    rng = np.random.default_rng(7)
    values = {"Kp": rng.uniform(0.1, 4.0, 300), "delay": rng.uniform(0.0, 0.6, 300)}
    found = dtm.sweep(loop, values)
    known = np.flatnonzero(found.status == dtm.loops.SweepStatus.OK)
    rates = np.full(300, np.nan)
    for place in known:
        alone = loop.replace(**{name: array[place] for name, array in values.items()})
        rates[place] = -alone.spectral_abscissa()
    for span in (5.0, 10.0, 40.0):
        inside = span - found["settling_time"][known]
        judged = dtm.sweep(loop, values, span)
        settled = judged.status[known] == dtm.loops.SweepStatus.OK
        assert settled[inside * rates[known] >= 3.0 * (1.0 + 1e-6)].all()
        # No time at all is not enough.
        assert not settled[inside <= 0.0].any()
        assert np.isfinite(judged["settling_time"][known[settled]]).all()


@settings(max_examples=40, deadline=None)
@given(loop=loops(st.sampled_from([None, 0.7])))
def test_random_loops_respond_as_alone(loop):
    times = np.linspace(0.0, 3.0, 31)
    try:
        one = loop.simulate(times)
    except ValueError:
        assume(False)
    found = dtm.sweep(loop, {"delay": [loop.delay]}, times, responses=True)
    size = 1.0 + np.max(np.abs(one.outputs))
    np.testing.assert_allclose(found.outputs[0] / size, one.outputs / size, atol=1e-13)


def test_progress_counts_the_sets():
    seen = []
    dtm.sweep(LOOPS[-3], {"Kp": np.linspace(1.0, 2.0, 300)}, 60.0, progress=seen.append)
    assert seen == sorted(seen)
    assert all(0 <= n <= 300 for n in seen)


def test_the_best_set_is_named():
    found = dtm.sweep(DRONE, {"Kp": np.array([0.5, 1.2, 2.9])}, 10.0)
    assert found.best() == {"Kp": 1.2}
    assert found.best("peak") == {"Kp": 0.5}
    with pytest.raises(KeyError, match="which contains rise_time"):
        found["gain"]
    with pytest.raises(ValueError, match="no set of parameters has a settling_time"):
        dtm.sweep(DRONE, {"Kp": [0.5]}, 1.0).best()
    assert not found["overshoot"].flags.writeable


@pytest.mark.parametrize(
    ("values", "time", "words"),
    [
        ({"mass": [1.0]}, 5.0, "mass"),
        ({"Kp": np.array([1.0, np.nan])}, 5.0, "nan"),
        ({"delay": np.array([0.1, -0.2])}, 5.0, "delay=-0.2"),
        ({"gain": np.array([1.0, 0.0])}, 5.0, "gain=0"),
        ({"Kp": np.array([1.0, 0.0])}, 5.0, "loop is open"),
        ({"Kp": [1.0]}, -5.0, "time=-5"),
        ({"Kp": [1.0]}, [0.0, 2.0, 1.0], "is not later than"),
    ],
)
def test_bad_arguments_are_named(values, time, words):
    with pytest.raises(ValueError, match=words):
        dtm.sweep(DRONE, values, time)


def test_a_sweep_without_a_delay_is_refused():
    with pytest.raises(ValueError, match="delay"):
        dtm.sweep(DRONE.replace(delay=None), {"Kp": [1.0]}, 5.0)
    with pytest.raises(TypeError, match="dict"):
        dtm.sweep(DRONE, [1.0], 5.0)
    with pytest.raises(ValueError, match="output times"):
        dtm.sweep(DRONE, {"Kp": [1.0]}, 5.0, responses=True)


def test_without_a_time_sets_are_measured_until_they_settle():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
    found = dtm.sweep(loop, {"Kp": np.array([0.1, 1.0, 3.0])})
    # Kp = 0.1 takes 40 s to settle, ten delays are 3.6 s.
    assert found.time[-1] >= 40.0
    assert (found.status == dtm.loops.SweepStatus.OK).all()
    for i, gain in enumerate((0.1, 1.0, 3.0)):
        info = loop.replace(Kp=gain).step_response().info()
        assert found["settling_time"][i] == pytest.approx(info["settling_time"], abs=1e-6)
    grid = dtm.sweep(loop, {"Kp": [[0.1], [9.0]], "delay": [[0.1, 0.36]]})
    assert grid.shape == (2, 2)
    # 9 * 0.36 is beyond pi/2: that loop never settles.
    assert grid.status.tolist()[0] == [0, 0]
    assert grid.status[1, 1] != dtm.loops.SweepStatus.OK
    with pytest.raises(ValueError, match="responses need output times"):
        dtm.sweep(loop, {"Kp": [1.0]}, responses=True)
