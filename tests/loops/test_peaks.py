"""Ms, Mt, disk margin and H-infinity norm against ball arithmetic and closed forms."""

import math
import random

import deadtime as dtm
import numpy as np
import pytest
from ball_grids import largest_gain
from deadtime import delay, s
from flint import acb_series
from scipy.optimize import brentq, minimize_scalar

#: Relative distance of a bound on a grid of balls from the value that it encloses.
NEAR = 4e-10

#: The lowest frequency of the grids, and the highest one of balls, rad/s.
LOW, HIGH = 1e-3, 300.0

#: Lots drawn in the default tests, and in the survey.
FEW, MANY = 12, 200


def loop_by_lot(seed):
    """A stable loop, its plant and controller drawn by lot."""
    lot = random.Random(seed)
    while True:
        plants = [
            dtm.Integrator(lot.uniform(0.3, 2), lot.choice([0, lot.uniform(0.05, 0.5)])),
            dtm.FirstOrder(lot.uniform(0.3, 2), lot.uniform(0.2, 3)),
            dtm.RationalPlant([lot.uniform(-0.3, 0.3), 1.0], [lot.uniform(0.05, 1), 0.7, 1.0]),
        ]
        smooth = dtm.DerivativeFilter(lot.uniform(10, 60), lot.uniform(0.5, 1))
        controllers = [
            dtm.P(lot.uniform(0.1, 3)),
            dtm.PI(lot.uniform(0.1, 2), lot.uniform(0.02, 1)),
            dtm.PV(lot.uniform(0.1, 3), lot.uniform(-0.1, 0.4), lot.choice([None, smooth])),
            dtm.PID(lot.uniform(0.1, 2), lot.uniform(0.02, 1), lot.uniform(0, 0.3), smooth),
        ]
        loop = dtm.ControlLoop(
            lot.choice(plants),
            lot.choice(controllers),
            delay=lot.choice([0.0, lot.uniform(0.01, 1.0)]),
            sample_time=lot.choice([None, None, lot.uniform(0.01, 0.2)]),
        )
        if loop.is_stable() and loop.spectral_abscissa() < -1e-2:
            return loop


def balls_of(loop):
    """Numerator and denominator of the loop gain, as functions of a series of balls."""

    def function(h):
        def value(at):
            total = acb_series([0])
            for row, tau in zip(h.coefficients, h.delays, strict=True):
                part = acb_series([0])
                for c in row[::-1]:
                    part = part * at + float(c)
                total += part * (at * -float(tau)).exp()
            return total

        return value

    gain = loop.open_loop()
    return function(gain.num), function(gain.den)


def largest_of_held(loop, of):
    """The largest modulus of a function of the loop gain of a sampled loop, from a dense grid."""
    top = math.pi / loop.sample_time
    omega = np.geomspace(LOW, top, 4001)
    sizes = np.abs(of(loop.frequency_response(omega), 1.0))
    best = int(np.argmax(sizes))
    ends = omega[max(best - 1, 0)], omega[min(best + 1, len(omega) - 1)]
    near = minimize_scalar(
        lambda w: -abs(of(complex(loop.frequency_response(w)), 1.0)),
        bounds=ends,
        method="bounded",
        options={"xatol": 1e-9 * ends[1]},
    )
    return max(-near.fun, sizes[best])


def compare(seed):
    loop = loop_by_lot(seed)
    found = loop.margin()
    functions = {
        "max_sensitivity": lambda n, d: d / (d + n),
        "max_complementary_sensitivity": lambda n, d: n / (d + n),
        "disk_margin": lambda n, d: (d - n) / (2 * (d + n)),
    }
    for name, of in functions.items():
        value = getattr(found, name)
        if name == "disk_margin":
            value = 1.0 / value
        omega, high = getattr(found, f"{name}_omega"), HIGH
        if loop.sample_time is None:
            least = largest_gain(closed(*balls_of(loop), of), LOW, high, NEAR)
        else:
            least = largest_of_held(loop, of)
            high = math.inf
        assert least <= value * (1 + 1e-9), (seed, name, loop)
        if LOW < omega < high:
            assert value == pytest.approx(least, rel=1e-9), (seed, name, loop)


def closed(num, den, of):
    return lambda at: of(num(at), den(at))


@pytest.mark.parametrize("seed", range(FEW))
def test_sensitivities_are_those_of_grids_of_balls(seed):
    compare(seed)


@pytest.mark.survey
@pytest.mark.long
@pytest.mark.parametrize("seed", range(FEW, MANY))
def test_more_sensitivities_are_those_of_grids_of_balls(seed):
    compare(seed)


def test_the_largest_gain_of_an_integrator_with_sixty_degrees():
    # K tau = pi/6 (phase margin 90 degrees less K tau).
    tau = 0.36
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=tau)
    K = brentq(lambda K: loop.replace(Kp=K).margin().phase_margin - 60.0, 0.1, 4.0, xtol=1e-15)
    assert K * tau == pytest.approx(math.pi / 6, abs=1e-9)


def test_the_sensitivity_of_an_integrator_in_closed_form():
    # |1 + L|^2 = 1 - 2 K sin(x)/x T + (K T/x)^2 with x = omega T is least where its derivative is
    # zero.
    K, T = 2.0, 0.36

    def slope(w):
        return -2 * K * (T * math.cos(w * T) / w - math.sin(w * T) / w**2) - 2 * K**2 / w**3

    omega = brentq(slope, 2.0, 6.0, xtol=1e-15)
    least = 1 - 2 * K * math.sin(omega * T) / omega + (K / omega) ** 2
    found = dtm.ControlLoop(dtm.Integrator(), dtm.P(K), delay=T).margin()
    assert found.max_sensitivity == pytest.approx(1 / math.sqrt(least), rel=1e-10)
    assert found.max_sensitivity_omega == pytest.approx(omega, rel=1e-4)


def test_a_neutral_loop_counts_high_frequencies_strongly():
    # At high frequencies 1 + L comes to 1 + Kv exp(-j phi): Ms is 1/(1 - Kv) at least.
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(0.01, 0.6), delay=0.36)
    assert loop.margin().max_sensitivity >= 1 / 0.4
    G = (1 + 0.5 * delay(1.0)) / (1 + 0.2 * delay(1.0))
    assert G.hinf_norm() == pytest.approx(1.5 / 1.2, rel=1e-9)
    assert (1.0 / (1 + 0.2 * delay(1.0) + 0.3 * delay(2.5))).hinf_norm() == pytest.approx(2.0)
    neutral = (s + 0.4 * s * delay(0.7) + 1 + delay(0.7)) ** -1
    omega = np.linspace(0.0, 400.0, 400001)
    gains = np.abs(neutral.frequency_response(omega))
    assert neutral.hinf_norm() == pytest.approx(gains.max(), rel=1e-6)


def test_the_norm_of_what_is_not_stable_is_infinite():
    assert (1.0 / (s - 1)).hinf_norm() == math.inf
    assert (s / (1 + 0.0 * s)).hinf_norm() == math.inf
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(9.0), delay=0.36)
    assert loop.hinf_norm() == math.inf
    assert math.isnan(loop.margin().max_sensitivity)
    assert loop.replace(sample_time=0.065).hinf_norm("complementary") == math.inf


def test_norms_of_systems_agree():
    loop = dtm.ControlLoop(dtm.FirstOrder(2.0, 1.0), dtm.PI(0.5, 0.4), delay=0.36)
    found = loop.margin()
    assert loop.hinf_norm() == found.max_sensitivity
    assert loop.open_loop().sensitivity().hinf_norm() == pytest.approx(
        found.max_sensitivity, rel=1e-9
    )
    assert loop.hinf_norm("output") == pytest.approx(1.0, rel=1e-9)
    # The command for a step of the reference is its gain at first, at least.
    assert loop.hinf_norm("command") >= 0.5
    with pytest.raises(ValueError, match="of='gain'"):
        loop.hinf_norm("gain")
    with pytest.raises(ValueError, match="between samples"):
        loop.replace(sample_time=0.1).hinf_norm("output")
    A = {0.0: [[0.0, 1.0], [-1.0, -0.2]], 0.3: [[0.0, 0.0], [0.1, 0.0]]}
    system = dtm.DelaySystem(A, [[0.0], [1.0]], [[1.0, 0.0]])
    omega = np.linspace(0.0, 5.0, 500001)
    gains = np.abs(system.transfer_function().frequency_response(omega))
    assert system.hinf_norm() == pytest.approx(gains.max(), rel=1e-9)


def test_the_disk_margin_holds_its_gains_and_turns():
    loop = dtm.ControlLoop(dtm.FirstOrder(2.0, 1.0), dtm.PI(0.9, 0.9), delay=0.36)
    found = loop.margin()
    alpha = found.disk_margin
    assert (2 + alpha) / (2 - alpha) <= found.gain_margin
    assert math.degrees(2 * math.atan(alpha / 2)) <= found.phase_margin
    L = complex(loop.frequency_response(found.disk_margin_omega))
    assert abs((1 - L) / (1 + L)) / 2 == pytest.approx(1 / alpha, rel=1e-9)


def test_of_several_inputs_or_outputs_one_is_chosen():
    system = dtm.DelaySystem({0.3: -np.eye(2)}, {0.3: np.array([[2.0, 0.0], [1.0, 1.0]])})
    with pytest.raises(ValueError, match="has 2 outputs: choose one of them by output="):
        system.hinf_norm()
    with pytest.raises(ValueError, match="has 2 inputs: choose one of them by input="):
        system.hinf_norm(output=0)
    assert system.hinf_norm(0, 0) == pytest.approx(2.0 * system.hinf_norm(1, 0))
