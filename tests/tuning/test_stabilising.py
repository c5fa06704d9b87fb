"""Stabilising gains: closed forms, gains one by one, and designs for difficult plants."""

import math

import deadtime as dtm
import numpy as np
import pytest
from deadtime.tuning import critical_gain
from deadtime.tuning._stabilising import stable_gains
from scipy.linalg import expm

P1 = dtm.P(1.0)


def unstable(delay, gain=1.0, sample_time=None):
    """gain e^(-s delay)/(s - 1)."""
    plant = dtm.FirstOrder(-gain, -1.0)
    return dtm.ControlLoop(plant, P1, delay=delay, sample_time=sample_time)


@pytest.mark.parametrize("sample_time", [None, 0.05])
@pytest.mark.parametrize("gain", [1.0, -3.0])
def test_an_unstable_first_order_plant_is_stabilised_below_a_delay_of_its_time_constant(
    gain, sample_time
):
    # The search began at the gain 1, halved it, and told that no gain stabilises what 2 does.
    ((low, high),) = stable_gains(unstable(0.2, gain, sample_time)).intervals
    near, far = sorted((low, high), key=abs)
    assert near * gain == pytest.approx(1.0, rel=1e-9)
    if sample_time is None:
        # tan(0.2 w) = w, K = sqrt(1 + w^2)
        w = float(np.sqrt((far * gain) ** 2 - 1.0))
        assert np.tan(0.2 * w) == pytest.approx(w, rel=1e-9)
    for factor in (0.99, 1.01):
        loop = unstable(0.2, gain, sample_time)
        assert loop.replace(Kp=factor * near).is_stable() == (factor > 1.0)
        assert loop.replace(Kp=factor * far).is_stable() == (factor < 1.0)
    best = dtm.design(unstable(0.2, gain, sample_time), controller=dtm.P, objective="abscissa")
    if sample_time is None:
        # a double root at 1 - 1/T, with K T = e^(T - 1)
        assert best.gains["Kp"] * gain == pytest.approx(np.exp(0.2 - 1.0) / 0.2, rel=1e-5)
        assert best.abscissa == pytest.approx(1.0 - 5.0, rel=1e-3)


def test_without_delay_the_critical_gain_is_two_over_the_sample_time():
    loop = dtm.ControlLoop(dtm.Integrator(), P1, delay=0.0, sample_time=0.065)
    assert critical_gain(loop) == pytest.approx(2.0 / 0.065, rel=1e-9)


def test_a_narrow_stable_interval_far_from_zero_is_found():
    # Between 1 and 1.0013 lies one cell of the map from 0.02 to 1.25 times the critical gain.
    best = dtm.design(unstable(0.99), controller=dtm.P, objective="abscissa")
    assert best.abscissa == pytest.approx(1.0 - 1.0 / 0.99, rel=1e-2)
    assert (
        dtm.design(unstable(0.99), controller=dtm.PV, objective="abscissa").abscissa < best.abscissa
    )


def test_beyond_its_time_constant_a_proportional_gain_is_refused_and_a_derivative_found():
    with pytest.raises(ValueError, match=r"no proportional gain up to .* with its delay of 1.2 s"):
        dtm.design(unstable(1.2), controller=dtm.P, objective="abscissa")
    with pytest.raises(ValueError, match="no proportional gain"):
        critical_gain(unstable(1.2))
    best = dtm.design(unstable(1.2), objective="abscissa")
    assert best.abscissa < -0.5
    assert best.proved == ("stable",)


@pytest.mark.parametrize("sample_time", [None, 0.05])
@pytest.mark.parametrize("controller", [dtm.P, dtm.PV, dtm.PI])
def test_a_plant_of_negative_gain_has_the_mirrored_design(controller, sample_time):
    loop = dtm.ControlLoop(dtm.Integrator(0.7, 0.1), P1, delay=0.2, sample_time=sample_time)
    options = {"controller": controller, "shape": (41,) if controller is dtm.P else (25, 25)}
    options["objective"] = "abscissa"
    one = dtm.design(loop, **options)
    other = dtm.design(loop.replace(gain=-0.7), **options)
    for name, value in one.gains.items():
        assert other.gains[name] == pytest.approx(-value, rel=1e-3)
    assert other.abscissa == pytest.approx(one.abscissa, rel=1e-3)


@pytest.mark.parametrize("sample_time", [None, 0.05])
@pytest.mark.parametrize("gain", [1.0, -4.0])
def test_a_double_integrator_has_no_proportional_gain_but_a_design(gain, sample_time):
    plant = dtm.RationalPlant([gain], [1.0, 0.0, 0.0])
    loop = dtm.ControlLoop(plant, P1, delay=0.2, sample_time=sample_time)
    assert stable_gains(loop).intervals == ()
    best = dtm.design(loop, shape=(31, 31), objective="abscissa")
    assert best.abscissa < -2.0
    assert best.gains["Kp"] * gain > 0.0


def test_a_search_without_result_does_not_claim_impossibility():
    plant = dtm.RationalPlant([1.0], [1.0, 0.0, 0.0, 0.0])
    loop = dtm.ControlLoop(plant, P1, delay=0.2)
    with pytest.raises(
        ValueError, match=r"tried in Kp from .* nor in .* Other gains may be stable"
    ):
        dtm.design(loop, shape=(9, 9), objective="abscissa")


def own_matrix(A, B, C, gain, whole, part, period):
    """x' = A x + B u(t - whole period - part), u held: transition of x and commands under way."""
    n = len(A)
    big = np.zeros((n + 1, n + 1))
    big[:n, :n], big[:n, n] = A, B
    first, second, full = (expm(big * t) for t in (part, period - part, period))
    M = np.zeros((n + whole + 1, n + whole + 1))
    M[:n, :n] = full[:n, :n]
    feedback = -gain * np.append(C, np.zeros(whole + 1))
    # u_k in place n, older ones behind it
    M[n] = feedback
    for i in range(whole):
        M[n + 1 + i, n + i] = 1.0
    M[:n, n + whole] += second[:n, :n] @ first[:n, n]
    if whole:
        M[:n, n + whole - 1] += second[:n, n]
    else:
        M[:n] += np.outer(second[:n, n], feedback)
    return M


def random_plant(rng):
    """Integrators, oscillators, unstable and non-minimum phase ones, of either sign."""
    order = int(rng.integers(1, 4))
    den = np.array([1.0])
    while len(den) <= order:
        room = order + 1 - len(den)
        if room >= 2 and rng.random() < 0.4:
            w, z = rng.uniform(0.5, 4.0), rng.choice([0.0, 0.1, 0.7, -0.1])
            den = np.convolve(den, [1.0, 2.0 * z * w, w * w])
        else:
            den = np.convolve(den, [1.0, float(rng.choice([0.0, rng.uniform(0.3, 3.0), -0.8]))])
    num = np.array([rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 3.0)])
    if order > 1 and rng.random() < 0.5:
        num = np.convolve(num, [1.0, float(rng.choice([1.0, -1.0]) * rng.uniform(0.3, 3.0))])
    return num, den


def companion(num, den):
    n = len(den) - 1
    A = np.diag(np.ones(n - 1), 1)
    A[-1] = -den[:0:-1]
    C = np.zeros(n)
    C[: len(num)] = num[::-1]
    return A, np.eye(n)[-1], C


def inside(gain, intervals):
    return any(low < gain < high for low, high in intervals)


def near(gain, intervals):
    ends = [end for ends in intervals for end in ends] + [0.0]
    return min(abs(gain - end) for end in ends) < 1e-3 * abs(gain)


@pytest.mark.parametrize("seed", range(4))
def test_random_plants_gain_by_gain(seed):
    rng = np.random.default_rng(seed)
    gains = np.concatenate([sign * np.geomspace(1e-2, 1e2, 12) for sign in (-1.0, 1.0)])
    for _ in range(8):
        num, den = random_plant(rng)
        late = float(rng.choice([0.1, 0.37, 0.9]))
        loop = dtm.ControlLoop(dtm.RationalPlant(num, den), P1, delay=late)
        found = stable_gains(loop).intervals
        for gain in gains[np.abs(gains) < stable_gains(loop).most]:
            if not near(gain, found):
                assert loop.replace(Kp=gain).is_stable() == inside(gain, found), (loop, gain)
        period = 0.07
        found = stable_gains(loop.replace(sample_time=period)).intervals
        whole = int(late // period)
        for gain in gains:
            M = own_matrix(*companion(num, den), gain, whole, late - whole * period, period)
            stable = np.abs(np.linalg.eigvals(M)).max() < 1.0
            if not near(gain, found):
                assert stable == inside(gain, found), (loop, gain)


# What is no loop


def test_a_transfer_function_is_no_loop_and_is_told_what_is():
    # It raised AttributeError.
    with pytest.raises(
        TypeError, match=r"TransferFunction is not a ControlLoop.*ControlLoop\(plant"
    ):
        dtm.sweep(2.0 / dtm.s * dtm.delay(0.3), {"K": 1})


@pytest.mark.parametrize("ask", [dtm.design, dtm.design_filter])
def test_what_is_neither_loop_nor_plant_is_told_what_is(ask):
    with pytest.raises(TypeError, match="give a plant"):
        ask("2/s")


# Plants in the place of loops


def test_a_plant_is_designed_for_as_the_loop_around_it():
    G = 0.9 / (dtm.s * (0.1 * dtm.s + 1.0)) * dtm.delay(0.2)
    loop = dtm.ControlLoop(dtm.Integrator(0.9, 0.1), P1, delay=0.3)
    wanted = dtm.design(loop, fixed={"Kv": 0.1}, delay=(0.3, 0.4), objective="abscissa")
    found = dtm.design(G, fixed={"Kv": 0.1}, delay=(0.1, 0.2), objective="abscissa")
    assert found.delays == pytest.approx(wanted.delays)
    assert found.gains["Kp"] == pytest.approx(wanted.gains["Kp"], rel=1e-6)
    assert found.abscissa == pytest.approx(wanted.abscissa, rel=1e-6)
    assert dtm.design(G, fixed={"Kv": 0.1}, objective="abscissa").delays == (0.2,)
    with pytest.raises(ValueError, match="delay of the loop is not known"):
        dtm.design(0.9 / dtm.s, objective="abscissa")


def test_gains_for_a_plant_with_delays_inside_are_found_in_given_ranges():
    """s + (0.5 + K) e^(-s): the best K makes the two rightmost roots meet, K + 0.5 = 1/e."""
    G = 1.0 / (dtm.s + 0.5 * dtm.delay(1.0))
    loop = dtm.ControlLoop(G, P1, delay=1.0)
    with pytest.raises(ValueError, match="give ranges="):
        dtm.design(loop, controller=dtm.P, objective="abscissa")
    found = dtm.design(loop, controller=dtm.P, ranges={"Kp": (-0.4, 0.5)}, objective="abscissa")
    assert found.gains["Kp"] == pytest.approx(math.exp(-1) - 0.5, abs=1e-4)
    assert found.abscissa == pytest.approx(-1.0, abs=1e-2)
    assert found.proved == ("stable",)
    with pytest.raises(ValueError, match="state space"):
        dtm.design(loop, controller=dtm.P, ranges={"Kp": (-0.4, 0.5)}, objective="settling_time")


@pytest.mark.parametrize(
    "given", [{"fixed": ["Kp"]}, {"fixed": "Kp"}, {"ranges": ["Kp"]}, {"ranges": {"Kp": 3.0}}]
)
def test_gains_are_given_by_name_in_a_dict(given):
    with pytest.raises(TypeError, match="give"):
        dtm.design(
            dtm.ControlLoop(dtm.Integrator(), P1, delay=0.3),
            controller=dtm.P,
            objective="abscissa",
            **given,
        )
