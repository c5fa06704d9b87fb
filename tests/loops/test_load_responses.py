"""Responses to loads, disturbances of the output and noise, and their figures."""

import deadtime as dtm
import numpy as np
import pytest

from tests.support.simulated_loops import Diagram, simulated

TIMES = np.linspace(0.0, 6.0, 61)
LOAD = ((1.03, 0.4), (3.21, -0.2))
OUTPUT = ((2.0, 0.3),)
FILTER = dtm.DerivativeFilter(15.0, 0.8)
PLANT = dtm.Integrator(1.2, 0.3)
SLOW = dtm.FirstOrder(2.0, 5.0)


def pairs(jumps):
    return tuple(np.array(jumps).T)


def diagram(loop, **parts):
    """The same loop for the other simulator."""
    num, den = loop.plant.polynomials()
    gains = {"Kp": 0.0} | dict(loop.controller.gains)
    bound = np.inf if loop.limit is None else loop.limit
    return Diagram(
        tuple(num),
        tuple(den),
        smooth=(15.0, 0.8) if "Kd" in gains else None,
        delay=loop.delay,
        is_measured=loop.delay_path == "measurement",
        sample_time=loop.sample_time,
        low=-bound,
        high=bound,
        **gains,
        **parts,
    )


@pytest.mark.parametrize("sample_time", [None, 0.065])
@pytest.mark.parametrize("delay", [0.0, 0.36])
@pytest.mark.parametrize("limit", [None, 0.7])
def test_loads_and_disturbances_agree_with_another_simulator(sample_time, delay, limit):
    controller = dtm.PID(1.1, 0.4, 0.2, FILTER)
    loop = dtm.ControlLoop(PLANT, controller, delay=delay, sample_time=sample_time, limit=limit)
    truth = simulated(
        diagram(loop, reference=((0.0, 1.0),), load=LOAD, output=OUTPUT, noise=((0.5, 0.01),)),
        TIMES,
    )
    found = loop.simulate(
        TIMES, load=pairs(LOAD), output_disturbance=pairs(OUTPUT), noise=pairs(((0.5, 0.01),))
    )
    np.testing.assert_allclose(found.outputs, truth[0], atol=1e-11)
    np.testing.assert_allclose(found.inputs, truth[1], atol=1e-11)


def test_with_the_delay_in_the_measurement_the_plant_feels_a_load_at_once():
    loop = dtm.ControlLoop(PLANT, dtm.PI(1.0, 0.3), delay=0.36, delay_path="measurement")
    truth = simulated(diagram(loop, load=LOAD, output=OUTPUT), TIMES)
    found = loop.simulate(TIMES, 0.0, load=pairs(LOAD), output_disturbance=pairs(OUTPUT))
    np.testing.assert_allclose(found.outputs, truth[0], atol=1e-11)
    np.testing.assert_allclose(found.inputs, truth[1], atol=1e-11)


def test_a_function_is_followed_as_closely_as_jumps():
    """The response to sin(2 t), from the frequency response once all else has decayed."""
    loop = dtm.ControlLoop(SLOW, dtm.PI(1.2, 0.3), delay=0.4)
    times = np.array([0.0, *np.linspace(60.0, 61.0, 6)])
    found = loop.simulate(times, 0.0, load=lambda t: np.sin(2.0 * t)).outputs
    s = 2.0j
    G, C, late = 2.0 / (5.0 * s + 1.0), 1.2 + 0.3 / s, np.exp(-0.4 * s)
    gain = G / (1.0 + G * C * late)
    truth = (gain * np.exp(s * times)).imag
    np.testing.assert_allclose(found[1:], truth[1:], atol=1e-10)
    followed = loop.simulate(times, lambda t: np.sin(2.0 * t)).outputs
    truth = (gain * C * late * np.exp(s * times)).imag
    np.testing.assert_allclose(followed[1:], truth[1:], atol=1e-10)


def test_a_function_that_jumps_is_one_with_jumps():
    loop = dtm.ControlLoop(PLANT, dtm.P(0.8), delay=0.2)
    found = loop.simulate(TIMES, 0.0, load=lambda t: np.where(t < 1.25, 0.0, 0.5))
    truth = loop.simulate(TIMES, 0.0, load=([1.25], [0.5]))
    np.testing.assert_allclose(found.outputs, truth.outputs, atol=1e-9)


def test_a_fast_function_late_in_a_run_is_followed():
    """The argument of the sine is rounded by more than the fit is to be exact to."""
    loop = dtm.ControlLoop(SLOW, dtm.PI(1.2, 0.3), delay=0.4)
    times = np.array([0.0, *np.linspace(99.0, 100.0, 6)])
    found = loop.simulate(times, 0.0, load=lambda t: np.sin(80.0 * t)).outputs
    s = 80.0j
    G, C, late = 2.0 / (5.0 * s + 1.0), 1.2 + 0.3 / s, np.exp(-0.4 * s)
    truth = (G / (1.0 + G * C * late) * np.exp(s * times)).imag
    np.testing.assert_allclose(found[1:], truth[1:], atol=1e-9)


def test_a_pulse_that_the_output_times_show_is_not_missed():
    loop = dtm.ControlLoop(PLANT, dtm.P(0.8), delay=0.2)
    times = np.linspace(0.0, 100.0, 10_001)
    found = loop.simulate(
        times, 0.0, load=lambda t: np.where((t > 40.003) & (t < 40.018), 1.0, 0.0)
    )
    truth = loop.simulate(times, 0.0, load=([40.003, 40.018], [1.0, 0.0]))
    np.testing.assert_allclose(found.outputs, truth.outputs, atol=1e-8)
    assert np.abs(truth.outputs).max() > 0.01


def test_a_function_without_end_of_its_changes_is_refused():
    loop = dtm.ControlLoop(PLANT, dtm.P(0.8), delay=0.2)
    draw = np.random.default_rng(1)
    with pytest.raises(ValueError, match=r"load changes too often: .* a pair \(times, values\)"):
        loop.simulate(TIMES, 0.0, load=lambda t: draw.normal(size=t.shape))


def test_a_sampled_loop_reads_a_function_at_its_samples():
    loop = dtm.ControlLoop(PLANT, dtm.P(0.8), delay=0.2, sample_time=0.1)
    samples = np.arange(61) * 0.1
    found = loop.simulate(TIMES, np.cos)
    held = loop.simulate(TIMES, np.cos(samples), reference_time=samples)
    np.testing.assert_allclose(found.outputs, held.outputs, atol=1e-12)


def test_noise_is_drawn_from_its_seed_at_the_samples():
    loop = dtm.ControlLoop(PLANT, dtm.P(0.8), delay=0.2, sample_time=0.1)
    first, again = (loop.simulate(TIMES, 0.0, noise=0.1, seed=3).inputs for _ in range(2))
    np.testing.assert_array_equal(first, again)
    drawn = 0.1 * np.random.default_rng(3).standard_normal(61)
    # Until the first command arrives the output rests, and the command is that of the noise alone.
    np.testing.assert_allclose(first[:3], -0.8 * drawn[:3], atol=1e-15)
    assert not np.array_equal(first, loop.simulate(TIMES, 0.0, noise=0.1, seed=4).inputs)
    model = dtm.experiments.FlightNoise(white=0.1)
    assert np.ptp(loop.simulate(TIMES, 0.0, noise=model, seed=1).inputs) > 0.0


@pytest.mark.parametrize("sample_time", [None, 0.1])
@pytest.mark.parametrize("at", ["input", "output"])
@pytest.mark.parametrize(
    ("plant", "controller"),
    [
        (SLOW, dtm.PI(1.2, 0.3)),
        (PLANT, dtm.PID(1.1, 0.1, 0.2, FILTER)),
        (dtm.Integrator(), dtm.PI(1.0, 0.2)),
    ],
)
def test_figures_are_those_of_a_fine_simulation(plant, controller, at, sample_time):
    loop = dtm.ControlLoop(plant, controller, delay=0.3, sample_time=sample_time)
    found = loop.load_response(size=0.5, at=at)
    times = np.linspace(0.0, 90.0, 9001)
    name = "load" if at == "input" else "output_disturbance"
    outputs = loop.simulate(times, 0.0, **{name: 0.5}).outputs
    size = np.abs(outputs)
    assert found.peak == pytest.approx(size.max(), rel=1e-5)
    assert found.iae == pytest.approx(np.trapezoid(size, times), rel=1e-3)
    assert found.ie == pytest.approx(np.trapezoid(outputs, times), rel=1e-2, abs=2e-3)
    last = times[np.flatnonzero(size > 0.02 * found.peak)[-1]]
    assert found.recovery_time == pytest.approx(last, abs=0.011)
    if at == "input":
        assert found.ie == pytest.approx(0.5 / controller.Ki, rel=1e-9)
        assert found.iae >= abs(found.ie) * (1.0 - 1e-6)


def test_a_slow_end_of_a_response_is_not_missed():
    loop = dtm.ControlLoop(dtm.FirstOrder(1.0, 1.0), dtm.PI(1.0, 0.01), delay=0.5)
    found = loop.load_response()
    assert found.iae == pytest.approx(100.0, rel=1e-6)
    assert loop.load_response(20.0).iae < 20.0


def test_what_does_not_come_to_rest_says_so():
    offset = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.1).load_response()
    assert offset.iae == offset.ie == np.inf
    assert np.isnan(offset.recovery_time)
    assert offset.steady_state == pytest.approx(0.5)
    unstable = dtm.ControlLoop(dtm.Integrator(), dtm.PI(9.0, 1.0), delay=0.3)
    for limit in (None, 1.0):
        with pytest.raises(ValueError, match=r"1e150|come to rest within .* after the load"):
            unstable.replace(limit=limit).load_response()
    growing = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=2.0)
    with pytest.raises(ValueError, match="come to rest within"):
        growing.load_response()
    assert growing.load_response(30.0).peak > 1.0
    found = dtm.sweep(unstable, {"Kp": np.array([9.0, 1.0])}, metrics=["load_iae", "iae"])
    assert np.isnan([found["load_iae"][0], found["iae"][0]]).all()
    assert found.status.tolist() == [2, 0]


def test_a_sweep_has_the_figures_of_each_loop():
    loop = dtm.ControlLoop(SLOW, dtm.PI(1.2, 0.3), delay=0.4, sample_time=0.1)
    Kp = np.array([0.6, 1.2, 2.0])
    names = ("settling_time", "iae", "load_iae", "load_peak", "load_recovery_time", "load_ie")
    found = dtm.sweep(loop, {"Kp": Kp}, metrics=names)
    assert tuple(found.metrics) == names
    plain = dtm.sweep(loop, {"Kp": Kp})
    np.testing.assert_array_equal(found["settling_time"], plain["settling_time"])
    for i, gain in enumerate(Kp):
        one = loop.replace(Kp=float(gain)).load_response()
        assert found["load_iae"][i] == one.iae
        assert found["load_peak"][i] == one.peak
        assert found["load_recovery_time"][i] == one.recovery_time
        times = np.linspace(0.0, 100.0, 10_001)
        step = loop.replace(Kp=float(gain)).simulate(times)
        iae = np.trapezoid(np.abs(1.0 - step.outputs), times)
        assert found["iae"][i] == pytest.approx(iae, rel=1e-4)


def test_wrong_arguments_are_named():
    loop = dtm.ControlLoop(PLANT, dtm.PI(1.0, 0.3), delay=0.2)
    with pytest.raises(ValueError, match="at='plant'"):
        loop.load_response(at="plant")
    with pytest.raises(ValueError, match="size=0"):
        loop.load_response(size=0.0)
    with pytest.raises(ValueError, match=r"load has shape \(3,\)"):
        loop.simulate(TIMES, load=[1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="choose from"):
        dtm.sweep(loop, {"Kp": [1.0]}, metrics=["load_size"])
    with pytest.raises(ValueError, match="sensitivities"):
        loop.simulate(TIMES, load=1.0, sensitivities=("delay",))


def test_a_plant_with_delays_inside_feels_loads_as_its_parts_do():
    """G1 + G2 e^(-0.5 s), against the same plant whose second part is under way outside."""
    s = dtm.s
    G = 1.0 / (s + 1.0) * (1.0 + 0.0 * dtm.delay(0.5))
    inside = dtm.ControlLoop(G, dtm.PI(0.8, 0.4), delay=0.3)
    plain = dtm.ControlLoop(dtm.FirstOrder(1.0, 1.0), dtm.PI(0.8, 0.4), delay=0.3)
    mixed = dtm.ControlLoop((1.0 + 0.2 * dtm.delay(0.5)) / (s + 1.0), dtm.PI(0.8, 0.4), delay=0.3)
    given = {"load": pairs(LOAD), "output_disturbance": pairs(OUTPUT), "noise": ([0.5], [0.1])}
    if not inside.plant.is_rational:
        found = inside.simulate(TIMES, 0.0, **given)
        truth = plain.simulate(TIMES, 0.0, **given)
        np.testing.assert_allclose(found.outputs, truth.outputs, atol=1e-9)
        np.testing.assert_allclose(found.inputs, truth.inputs, atol=1e-9)
    # Linear: the response to all is the sum of those to each.
    whole = mixed.simulate(TIMES, 1.0, **given).outputs
    parts = [mixed.simulate(TIMES, 1.0).outputs]
    parts += [mixed.simulate(TIMES, 0.0, **{name: put}).outputs for name, put in given.items()]
    np.testing.assert_allclose(whole, np.sum(parts, axis=0), atol=1e-12)
    # Until the second part arrives, a load acts through the first alone.
    early = mixed.simulate(np.linspace(0.0, 0.5, 6), 0.0, load=1.0)
    np.testing.assert_allclose(early.outputs[:4], 1.0 - np.exp(-early.time[:4]), atol=2e-2)
    with pytest.raises(ValueError, match="number or an array"):
        mixed.simulate(TIMES, np.sin)


def test_steady_states_count_loads():
    loop = dtm.ControlLoop(dtm.FirstOrder(2.0, 1.0), dtm.P(1.5), delay=0.2)
    found = loop.simulate(np.linspace(0.0, 60.0, 61), 1.0, load=0.5, output_disturbance=0.2)
    assert found.steady_state == pytest.approx(found.outputs[-1], abs=1e-9)
    assert loop.simulate(TIMES, 1.0, noise=0.1).steady_state is None


@pytest.mark.parametrize("name", ["reference", "output_disturbance", "noise"])
@pytest.mark.parametrize("sample_time", [None, 0.1])
@pytest.mark.parametrize("kind", [dtm.PD, dtm.PV, dtm.PID])
def test_an_ideal_derivative_sees_the_rate_of_a_smooth_input(name, sample_time, kind):
    """As the limit of filters whose corner goes to infinity: the error falls with it."""
    gains = (1.0, 0.1, 0.5) if kind is dtm.PID else (1.0, 0.5)
    times = np.linspace(0.0, 5.0, 26)
    given = {"reference": 0.0} | {name: lambda t: np.sin(t) ** 2}

    def outputs(smooth):
        controller = kind(*gains, smooth)
        loop = dtm.ControlLoop(
            dtm.FirstOrder(2.0, 10.0), controller, delay=2.0, sample_time=sample_time
        )
        return loop.simulate(times, **given).outputs

    ideal = outputs(None)
    errors = [np.abs(outputs(dtm.DerivativeFilter(w, 0.7)) - ideal).max() for w in (200.0, 2000.0)]
    assert errors[1] < 2e-3
    assert errors[1] < 0.2 * errors[0]
