"""Plants as transfer functions and systems, of this package and of others."""

from __future__ import annotations

import math

import deadtime as dtm
import numpy as np
import pytest
from deadtime import delay, s
from deadtime.loops import PlantWithDelays
from scipy import signal
from scipy.linalg import expm

CONTROLLERS = [
    dtm.P(1.5),
    dtm.PV(1.5, 0.2, dtm.DerivativeFilter(38.0)),
    dtm.PI(1.0, 0.3),
]
#: (0.9 s + 3) / (s^2 + 2 s + 5)
NUM, DEN = [0.9, 3.0], [1.0, 2.0, 5.0]


def given_plants():
    """The same plant in every form there is, without a delay."""
    control = pytest.importorskip("control")
    A, B, C, D = signal.tf2ss(NUM, DEN)
    zeros, poles, gain = signal.tf2zpk(NUM, DEN)
    return {
        "transfer function": dtm.TransferFunction(NUM, DEN),
        "delay system": dtm.DelaySystem(A, B, C),
        "control transfer function": control.tf(NUM, DEN),
        "control state space": control.ss(A, B, C, D),
        "scipy lti": signal.lti(NUM, DEN),
        "scipy transfer function": signal.TransferFunction(NUM, DEN),
        "scipy state space": signal.StateSpace(A, B, C, D),
        "scipy zeros and poles": signal.ZerosPolesGain(zeros, poles, gain),
    }


@pytest.mark.parametrize("sample_time", [None, 0.05])
def test_the_same_plant_in_any_form_makes_the_same_loop(sample_time):
    known = dtm.ControlLoop(
        dtm.RationalPlant(NUM, DEN), CONTROLLERS[1], delay=0.2, sample_time=sample_time, limit=1.0
    )
    time = np.linspace(0.0, 5.0, 51)
    for name, plant in given_plants().items():
        loop = dtm.ControlLoop(plant, CONTROLLERS[1], delay=0.2, sample_time=sample_time, limit=1.0)
        assert isinstance(loop.plant, dtm.RationalPlant), name
        assert loop.spectral_abscissa() == pytest.approx(known.spectral_abscissa(), rel=1e-9), name
        np.testing.assert_allclose(
            loop.simulate(time).outputs, known.simulate(time).outputs, atol=1e-11, err_msg=name
        )


@pytest.mark.parametrize("controller", CONTROLLERS, ids=["p", "filtered pv", "pi"])
def test_a_delay_in_series_with_the_plant_is_the_loops(controller):
    G = 0.9 / (s * (0.1 * s + 1.0)) * delay(0.25)
    plant = dtm.Integrator(0.9, 0.1)
    for sample_time in (None, 0.065):
        loop = dtm.ControlLoop(G, controller, delay=0.11, sample_time=sample_time, limit=1.0)
        same = dtm.ControlLoop(plant, controller, delay=0.36, sample_time=sample_time, limit=1.0)
        assert loop.delay == same.delay == 0.36
        assert loop.plant == dtm.RationalPlant([0.9], [0.1, 1.0, 0.0])
        np.testing.assert_array_equal(
            loop.simulate([0, 1, 3]).outputs, same.simulate([0, 1, 3]).outputs
        )
        assert loop.margin().delay_margin == pytest.approx(same.margin().delay_margin, rel=1e-9)
    assert dtm.ControlLoop(G, controller).delay == 0.25
    assert dtm.ControlLoop(dtm.TransferFunction([1.0], [1.0, 0.0]), controller).delay is None
    assert loop.replace(Kp=1.0).delay == 0.36


def test_a_pure_delay_is_a_plant():
    """y(t) = integral of Ki (1 - y(t - T)): the rightmost pole is W(-Ki T)/T."""
    loop = dtm.ControlLoop(delay(0.5), dtm.PI(0.0, 0.6))
    pole = complex(dtm.lambertw(-0.3 + 0j, 0)) / 0.5
    assert loop.spectral_abscissa() == pytest.approx(pole.real, rel=1e-12)


def test_a_plant_with_its_delay_between_command_and_output_has_none_in_its_measurement():
    G = delay(0.25) / (s + 1.0)
    with pytest.raises(ValueError, match=r"delay_path='measurement' .* delay of 0\.25"):
        dtm.ControlLoop(G, dtm.P(1.0), delay_path="measurement")
    loop = dtm.ControlLoop(1.0 / (s + 1.0), dtm.P(1.0), delay=0.25, delay_path="measurement")
    assert loop.delay_path == "measurement"


def test_a_plant_of_python_control_gives_its_poles():
    """With a Padé approximant in the place of the delay, python-control finds nearly the same."""
    control = pytest.importorskip("control")
    G = control.tf([2.0, 1.0], [1.0, 3.0, 1.5, 0.2])
    loop = dtm.ControlLoop(G, dtm.PI(0.8, 0.2), delay=0.3)
    num, den = control.pade(0.3, 10)
    closed = control.feedback(G * control.tf([0.8, 0.2], [1.0, 0.0]) * control.tf(num, den))
    slow = closed.poles()[np.argsort(-closed.poles().real)][:3]
    found = loop.poles(re=(slow.real.min() - 0.01, 1.0), im=(-10, 10)).roots
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(slow), atol=1e-7)
    _, outputs = control.step_response(closed, np.linspace(0.0, 8.0, 41))
    np.testing.assert_allclose(loop.simulate(np.linspace(0.0, 8.0, 41)).outputs, outputs, atol=1e-4)


@pytest.mark.parametrize(
    ("plant", "error", "words"),
    [
        (dtm.TransferFunction([1.0, 0.0, 0.0], [1.0, 1.0]), ValueError, "differentiate"),
        (1.0 / (s * delay(0.1)), ValueError, "0.1 s before its command"),
        (dtm.DelaySystem(-np.eye(2), {0: np.eye(2)}), ValueError, "one input and one output"),
        (signal.dlti([1.0], [1.0, 0.5], dt=0.1), ValueError, "time step"),
        (s / (1.0 + delay(1.0)), ValueError, "differentiate"),
        (2.0, TypeError, "python-control"),
        ("1/s", TypeError, "python-control"),
    ],
    ids=["improper", "not causal", "two inputs", "sampled", "improper inside", "number", "text"],
)
def test_what_is_no_plant_is_refused(plant, error, words):
    with pytest.raises(error, match=words):
        dtm.ControlLoop(plant, dtm.P(1.0), delay=0.1)


# Delays inside the plant

INSIDE = 1.0 / (s + 0.5 * delay(1.0))


def test_a_loop_with_delays_inside_its_plant_in_closed_form():
    """s + 0.5 e^(-s) + K e^(-s) = 0 with the loop's delay equal to the plant's."""
    loop = dtm.ControlLoop(INSIDE, dtm.P(0.7), delay=1.0)
    assert isinstance(loop.plant, PlantWithDelays)
    pole = complex(dtm.lambertw(-1.2 + 0j, 0))
    assert loop.spectral_abscissa() == pytest.approx(pole.real, rel=1e-12)
    assert loop.stable_range("Kp")[1] == pytest.approx(math.pi / 2 - 0.5, rel=1e-12)
    assert loop.margin().gain_margin == pytest.approx((math.pi / 2 - 0.5) / 0.7, rel=1e-9)
    chart = dtm.stability_map(loop, {"Kp": (0.1, 2.0), "delay": (0.9, 1.1)}, shape=(20, 3))
    assert chart.stable[:, 1].sum() == np.count_nonzero(np.linspace(0.1, 2, 20) < math.pi / 2 - 0.5)
    # Method of steps: y = Kp (t - 1) up to t = 2, then y' = Kp - (Kp + 0.5) y(t - 1).
    found = loop.simulate([0.5, 1.5, 2.0, 3.0])
    response = loop.simulate([0.0, 1.5, 2.0, 3.0])
    assert response.outputs == pytest.approx([0.0, 0.35, 0.7, 1.4 - 1.2 * 0.35], abs=1e-13)
    assert response.inputs == pytest.approx([0.7, 0.7 * 0.65, 0.21, 0.7 * (1 - 0.98)], abs=1e-12)
    assert found.outputs[0] == 0.0
    assert response.steady_state == pytest.approx(0.7 / 1.2)


def test_a_delay_in_the_measurement_of_such_a_loop():
    late = dtm.ControlLoop(INSIDE, dtm.PI(0.4, 0.1), delay=0.3)
    early = late.replace(delay_path="measurement")
    time = np.linspace(0.0, 6.0, 25)
    np.testing.assert_allclose(
        early.simulate(np.append(0.0, time[1:]), 1.0).outputs,
        late.simulate(np.append(0.0, time[1:] + 0.3), 1.0).outputs * (time > -1.0),
        atol=1e-12,
    )


def test_such_a_loop_starts_at_rest_under_any_reference():
    loop = dtm.ControlLoop(INSIDE, dtm.P(0.7), delay=0.2)
    rest = 0.7 / 1.2
    held = loop.simulate([0.0, 2.0], 2.0, reference_before=2.0, initial_output=2.0 * rest)
    assert held.outputs == pytest.approx([2.0 * rest] * 2, rel=1e-12)
    jumped = loop.simulate([0.0, 2.0], [2.0, 3.0], reference_time=[-5.0, 1.0], reference_before=2.0,
                           initial_output=2.0 * rest)  # fmt: skip
    step = loop.simulate([0.0, 1.0])
    assert jumped.outputs[1] == pytest.approx(2.0 * rest + step.outputs[1], rel=1e-12)
    with pytest.raises(ValueError, match="initial_output=1: before the start the reference is 0"):
        loop.simulate([0.0, 1.0], initial_output=1.0, reference_before=0.0)
    assert loop.step_response().info()["overshoot"] > 0.0


def test_what_such_a_loop_cannot_do_is_refused_by_name():
    loop = dtm.ControlLoop(INSIDE, dtm.P(0.7), delay=0.2)
    with pytest.raises(ValueError, match=r"limit=1\.0: a hold or a limit"):
        loop.replace(limit=1.0)
    with pytest.raises(ValueError, match=r"sample_time=0\.1: a hold or a limit"):
        loop.replace(sample_time=0.1)
    with pytest.raises(ValueError, match="sensitivities"):
        loop.simulate([0.0, 1.0], sensitivities=("Kp",))
    with pytest.raises(ValueError, match="state space"):
        dtm.sweep(loop, {"Kp": (0.1, 0.2, 2)})
    with pytest.raises(ValueError, match="command of this loop an impulse"):
        dtm.ControlLoop(INSIDE, dtm.PD(0.1, 0.1), delay=0.2).step_response()


# Products


@pytest.mark.parametrize("controller", [*CONTROLLERS, dtm.PD(1.0, 0.2), dtm.PID(1.0, 0.2, 0.1)])
def test_a_plant_times_a_controller_is_the_loop_gain(controller):
    G = 0.9 / (s * (0.1 * s + 1.0)) * delay(0.25)
    L = dtm.ControlLoop(G, controller).open_loop()
    z = np.array([1j, 0.3 + 2j, -1.0 + 0.5j])
    for product in (G * controller, controller * G):
        assert isinstance(product, dtm.TransferFunction)
        np.testing.assert_allclose(product(z), L(z), rtol=1e-14)
    plant = dtm.Integrator(0.9, 0.1)
    np.testing.assert_allclose((plant * controller * delay(0.25))(z), L(z), rtol=1e-14)
    np.testing.assert_allclose((delay(0.25) * controller)(z), (controller * delay(0.25))(z))
    with pytest.raises(TypeError):
        controller * "1/s"


def test_products_with_plants_of_other_packages():
    control = pytest.importorskip("control")
    z = np.array([1j, 0.3 + 2j])
    wanted = 2.0 * np.polyval(NUM, z) / np.polyval(DEN, z)
    for plant in (control.tf(NUM, DEN), signal.lti(NUM, DEN)):
        for product in (plant * dtm.P(2.0), dtm.P(2.0) * plant):
            np.testing.assert_allclose(product(z), wanted, rtol=1e-14)


def test_the_matrix_form_and_the_transfer_function_agree():
    """A sampled loop around a state space, against its own transition by matrix exponentials."""
    A, B, C, _ = signal.tf2ss(NUM, DEN)
    loop = dtm.ControlLoop(signal.StateSpace(A, B, C, 0.0), dtm.P(1.2), delay=0.0, sample_time=0.1)
    held = expm(np.block([[A, B], [np.zeros((1, 3))]]) * 0.1)
    closed = held[:2, :2] - held[:2, 2:] @ (1.2 * C)
    poles = np.log(np.linalg.eigvals(closed).astype(complex)) / 0.1
    found = loop.poles().roots
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(poles), rtol=1e-9)
