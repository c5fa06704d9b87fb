"""Poles of control loops, continuous and sampled: decay, stability, ranges of parameters."""

from __future__ import annotations

import math

import deadtime as dtm
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from loops import INTEGRATOR, controllers, plants
from scipy.special import lambertw


@pytest.mark.parametrize(("kp", "delay"), [(1.31, 0.36), (2.4, 0.36), (5.0, 0.36), (2.4, 0.2)])
def test_responses_decay_with_the_rightmost_pole(kp, delay):
    """Continuous: s = W(-Kp Td)/Td."""
    pole = lambertw(-kp * delay) / delay
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(kp), delay=delay)
    assert decay(loop, 0.05) == pytest.approx(pole.real, abs=2e-5)


@pytest.mark.parametrize(
    "loop",
    [
        dtm.ControlLoop(INTEGRATOR, dtm.P(2.4), delay=0.36, sample_time=0.065),
        dtm.ControlLoop(dtm.kit_plant(), dtm.P(1.5), delay=0.26, sample_time=0.065),
        dtm.ControlLoop(
            INTEGRATOR,
            dtm.PV(3.2, 0.3, dtm.DerivativeFilter(38.0)),
            delay=0.36,
            sample_time=0.065,
        ),
        dtm.ControlLoop(dtm.FirstOrder(1.0, 0.5), dtm.PI(1.0, 3.0), delay=0.3, sample_time=0.1),
    ],
    ids=["p", "kit", "filtered pv", "pi"],
)
def test_sampled_responses_decay_with_the_abscissa(loop):
    assert decay(loop, loop.sample_time) == pytest.approx(loop.spectral_abscissa(), abs=2e-5)


def decay(loop, step):
    """Real part of the dominant pair from three-term recurrences late in a step response."""
    times = step * np.arange(int(8.0 / step))
    y = loop.simulate(times).outputs
    error = (y - 1.0)[len(y) * 5 // 8 :]
    recurrence = np.column_stack([error[1:-1], error[:-2]])
    _, product = np.linalg.lstsq(
        recurrence / np.abs(error[2:, None]).max(), error[2:] / np.abs(error[2:]).max()
    )[0]
    return math.log(-product) / (2.0 * step)


def test_transition_matrix_steps_the_loop():
    loop = dtm.ControlLoop(dtm.kit_plant(), dtm.PV(1.2, 0.1), delay=0.16, sample_time=0.065)
    matrix = loop.transition_matrix()
    assert matrix.shape == (5, 5)
    deviation = np.zeros(5)
    # At rest the second state of the observable form balances the first.
    deviation[:2] = [1.0, 5.820]
    found = loop.simulate(0.065 * np.arange(30), 0.0, initial_output=1.0)
    for k in range(30):
        assert found.outputs[k] == pytest.approx(deviation[0], abs=1e-13)
        deviation = matrix @ deviation


@pytest.mark.parametrize(
    ("delay", "sampled"), [(0.36, 4.024), (0.10, 12.46)], ids=["long delay", "short delay"]
)
def test_the_hold_costs_stability(delay, sampled):
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(0.5), delay=delay, sample_time=0.065)
    low, high = loop.stable_range("Kp")
    assert low == pytest.approx(0.0, abs=1e-12)
    assert high == pytest.approx(sampled, abs=5e-3 if delay == 0.1 else 5e-4)
    assert loop.replace(Kp=high * (1 - 1e-9)).is_stable()
    assert not loop.replace(Kp=high * (1 + 1e-9)).is_stable()


def test_range_of_the_delay_of_a_sampled_loop():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.36, sample_time=0.065)
    low, high = loop.stable_range("delay")
    assert low == 0.0
    assert loop.replace(delay=high - 1e-9).is_stable()
    assert not loop.replace(delay=high + 1e-9).is_stable()
    # A weak loop around a lag stands any delay.
    weak = dtm.ControlLoop(dtm.FirstOrder(1.0, 1.0), dtm.P(0.5), delay=0.1, sample_time=0.1)
    assert weak.stable_range("delay") == (0.0, math.inf)


def test_range_of_the_sample_time():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.0, sample_time=0.1)
    # 1 - Kp Ts > -1.
    low, high = loop.stable_range("sample_time")
    assert low == 0.0
    assert high == pytest.approx(1.0, rel=1e-12)
    late = loop.replace(delay=0.36)
    low, high = late.stable_range("sample_time")
    assert low == 0.0
    # z^2 - (1 - 2 (Ts - Td)) z + 2 Td = 0 meets z = -1 there.
    assert high == pytest.approx(1.72, rel=1e-12)


def test_sampled_poles_carry_their_rounding_error():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.1, sample_time=0.1)
    found = loop.rightmost(2)
    # z^2 - z + 0.2 = 0.
    z = np.roots([1.0, -1.0, 0.2])
    truth = np.sort(np.log(z) / 0.1)[::-1]
    assert (np.abs(np.asarray(found) - truth) <= found.radii).all()
    assert found.radii.max() < 1e-11
    assert found.resolved.all()
    pair = loop.replace(Kp=5.0).rightmost()
    assert len(pair) == pair.counted == 2
    assert pair[0] == pair[1].conjugate()
    assert pair[0].imag > 0.0


def test_what_is_gone_after_a_sample_is_no_pole():
    # Its one held command is an eigenvalue z of zero beside 1 - 2 Ts.
    found = dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.0, sample_time=0.1).rightmost(2)
    assert len(found) == 1
    assert found[0].real == pytest.approx(math.log(0.8) / 0.1, rel=1e-12)
    assert found.resolved.tolist() == [True]
    # y(k+1) = y(k) - 0.1 y(k-2), of which one state holds y alone.
    late = dtm.ControlLoop(INTEGRATOR, dtm.P(1.0), delay=0.2, sample_time=0.1)
    z = np.roots([1.0, -1.0, 0.0, 0.1])
    expected = np.sort(np.log(z[z.imag >= 0.0].astype(complex)).real / 0.1)
    np.testing.assert_allclose(np.sort(late.rightmost(8).roots.real), expected, rtol=1e-9)
    # At rest after one sample: no pole at all.
    at_once = late.replace(Kp=10.0, delay=0.0)
    assert len(at_once.rightmost(2)) == 0
    assert "0 roots" in repr(at_once.rightmost(2))
    assert at_once.spectral_abscissa() == -math.inf


# Continuous loops through their characteristic function


def test_characteristic_functions():
    s, delay = dtm.s, dtm.delay
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.36)
    assert loop.characteristic() == s + 2.0 * delay(0.36)
    neutral = loop.replace(controller=dtm.PV(2.0, 0.3))
    assert neutral.characteristic() == s + (2.0 + 0.3 * s) * delay(0.36)
    lagged = dtm.ControlLoop(dtm.Integrator(0.9, 0.2), dtm.PI(1.0, 0.5), delay=0.1)
    assert lagged.characteristic() == 0.2 * s**3 + s**2 + (0.9 * s + 0.45) * delay(0.1)


@given(plants, controllers, st.sampled_from([0.1, 0.36]))
@settings(deadline=None, max_examples=30)
def test_characteristic_function_is_the_determinant(plant, controller, delay):
    """Up to the factor that the plant's and the controller's denominators leave."""
    loop = dtm.ControlLoop(plant, controller, delay=delay)
    model, h = loop.specification.model, loop.characteristic()

    def determinant(s):
        n = len(model.B)
        matrix = np.zeros((n + 1, n + 1), dtype=complex)
        matrix[:n, :n] = s * np.eye(n) - model.A
        matrix[:n, n] = -model.B
        matrix[n, :n] = -model.K * np.exp(-s * delay)
        matrix[n, n] = 1.0 - model.L * np.exp(-s * delay)
        return np.linalg.det(matrix)

    points = [0.7 + 1.9j, -0.4 + 3.0j, 2.0 - 1.0j]
    ratios = [h(s) / determinant(s) for s in points]
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-9)


@pytest.mark.parametrize(
    ("loop", "name", "high"),
    [
        (dtm.ControlLoop(INTEGRATOR, dtm.P(1.0), delay=0.36), "Kp", math.pi / 0.72),
        (dtm.ControlLoop(INTEGRATOR, dtm.P(1.0), delay=0.10), "Kp", math.pi / 0.20),
        (dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.1), "delay", math.pi / 4.0),
        (dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.1), "gain", math.pi / 0.4),
    ],
)
def test_ranges_of_continuous_loops(loop, name, high):
    found = loop.stable_range(name)
    assert found[0] == 0.0
    assert found[1] == pytest.approx(high, rel=1e-12)


@pytest.mark.parametrize(
    ("derivative_filter", "high"), [(None, 0.9685), (dtm.DerivativeFilter(38.0), 0.890)]
)
def test_velocity_gain_of_the_paper(derivative_filter, high):
    """Armah & Yi: the largest Kv at Kp = 2, without and with their filter."""
    loop = dtm.ControlLoop(INTEGRATOR, dtm.PV(2.0, 0.3, derivative_filter), delay=0.36)
    assert loop.stable_range("Kv")[1] == pytest.approx(high, abs=5e-4)
    abscissa = {None: -3.3168, dtm.DerivativeFilter(38.0): -2.197}[derivative_filter]
    assert loop.spectral_abscissa() == pytest.approx(abscissa, abs=5e-4)


def test_a_neutral_loop_needs_strong_stability():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.0, 1.05), delay=0.36)
    assert not loop.is_stable()
    assert loop.replace(Kv=0.5).is_stable()


def test_stability_of_loops_without_a_delay():
    loop = dtm.ControlLoop(dtm.Integrator(1.0, 0.5), dtm.PI(1.0, 0.5), delay=0.0)
    # 0.5 s^3 + s^2 + s + Ki is stable for Ki < 2.
    assert loop.is_stable()
    assert loop.stable_range("Ki")[1] == pytest.approx(2.0, rel=1e-12)


@given(st.floats(0.5, 3.5), st.sampled_from([None, 0.1]))
@settings(deadline=None, max_examples=20)
def test_fast_sampling_has_the_poles_of_continuous_time(kp, lag):
    loop = dtm.ControlLoop(dtm.Integrator(lag=lag or 0.0), dtm.P(kp), delay=0.2)
    sampled = loop.replace(sample_time=1e-3).spectral_abscissa()
    # The hold is half a sample of delay, but for terms of Ts^2 |s|^3 / 12 about; next to a double
    # root (Kp 0.2 = 1/e) the poles move by the root of that.
    held = loop.replace(delay=0.2005).spectral_abscissa()
    assert sampled == pytest.approx(held, abs=0.02)


@given(plants, controllers)
@settings(deadline=None, max_examples=30)
def test_numbers_may_be_symbols(plant, controller):
    loop = dtm.ControlLoop(plant, controller, delay=0.3)
    family = loop._family_of(tuple(loop.parameters))
    h, symbolic = loop.characteristic(), family.at(**loop.parameters)
    points = np.array([0.7 + 1.9j, -0.4 + 3.0j, 2.0 - 1.0j])
    np.testing.assert_allclose(symbolic(points), h(points), rtol=1e-12)


@pytest.mark.parametrize("exponent", [-20, -7, 7, 19, 20])
@pytest.mark.parametrize("delay", [0.0, 0.36, 1.0])
def test_the_unit_of_the_command_changes_no_verdict(exponent, delay):
    """At gains near 1e19 a sampled loop was judged by the rounding of a badly scaled matrix."""
    unit = 10.0**exponent
    for kp in (0.9, 6.0):
        poles = []
        for c in (1.0, unit):
            loop = dtm.ControlLoop(
                dtm.Integrator(c, 0.1), dtm.PI(kp / c, 0.2 / c), delay=delay, sample_time=0.065
            )
            poles.append((loop.is_stable(), loop.spectral_abscissa()))
        assert poles[0][0] == poles[1][0]
        assert poles[1][1] == pytest.approx(poles[0][1], rel=1e-8)


def test_a_pole_next_to_one_is_decided_and_one_on_the_circle_refused():
    """z = 1 - 7e-19 rounds to one: it was refused, and the loop called unstable before."""
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.4e-17), delay=0.1, sample_time=0.05)
    assert loop.is_stable()
    assert loop.rightmost().roots[0] == pytest.approx(-1.4e-17, rel=1e-12)
    assert not loop.replace(Kp=1e20).is_stable()
    # z = 1 - Kp Ts = -1.
    with pytest.raises(ValueError, match="double precision cannot decide"):
        loop.replace(Kp=20.0, delay=0.0, sample_time=0.1).is_stable()


def exact_poles(loop, digits=60):
    """ln(z)/Ts of the eigenvalues z of the transition matrix, all in many digits."""
    import mpmath as mp

    with mp.workdps(digits):
        model, period = loop.specification.model, mp.mpf(loop.sample_time)
        n = len(model.B)
        joined = mp.zeros(n + 1)
        joined[:n, :n] = mp.matrix(model.A.tolist())
        joined[:n, n] = mp.matrix(model.B.tolist())
        whole = int(mp.floor(mp.mpf(loop.delay) / period))
        early = mp.mpf(loop.delay) - whole * period
        late, first = (mp.expm(joined * time) for time in (period - early, early))
        matrix = mp.zeros(n + whole + 1)
        matrix[:n, :n] = late[:n, :n] * first[:n, :n]
        feedback = mp.matrix(model.K.tolist()).T
        # The command that arrives within the sample, and the one before it.
        older, newer = late[:n, :n] * first[:n, n], late[:n, n]
        matrix[:n, n + whole] = older
        if whole:
            matrix[:n, n + whole - 1] = newer
        else:
            matrix[:n, :n] += newer * feedback
            matrix[:n, n] += newer * mp.mpf(float(model.L))
        matrix[n, :n] = feedback
        matrix[n, n + whole] += mp.mpf(float(model.L))
        for row in range(n + 1, n + whole + 1):
            matrix[row, row - 1] = 1
        z = [value for value in mp.eig(matrix, left=False, right=False) if abs(value) > 1e-25]
        return [mp.log(value) / period for value in z]


@pytest.mark.parametrize(
    "loop",
    [
        # Two poles meet at z = 1/2.
        dtm.ControlLoop(INTEGRATOR, dtm.P(2.5), delay=0.1, sample_time=0.1),
        dtm.ControlLoop(INTEGRATOR, dtm.P(1e-9), delay=0.36, sample_time=0.065),
        dtm.ControlLoop(
            dtm.Integrator(0.85, 0.1), dtm.PI(2.0, 0.2), delay=0.3, sample_time=1e-3
        ).replace(delay=5.5e-3),
        dtm.ControlLoop(INTEGRATOR, dtm.PV(2.0, 0.2), delay=0.36, sample_time=0.065),
        dtm.ControlLoop(
            dtm.FactoredPlant(pole_frequency=18.0, pole_damping=0.01),
            dtm.PID(0.1, 0.5, 0.01, dtm.DerivativeFilter(60.0)),
            delay=0.1,
            sample_time=0.03,
        ),
    ],
    ids=["double", "slow", "fast samples", "direct", "light mode"],
)
def test_discs_hold_the_poles_of_a_sampled_loop(loop):
    """Radii were of first order in the rounding: two simple poles where there is a double one."""
    pytest.importorskip("mpmath")
    exact = exact_poles(loop)
    found = loop.rightmost(20)
    assert found.counted == found.multiplicities.sum() == len(exact)
    for root, radius, multiplicity in zip(
        found.roots.tolist(), found.radii.tolist(), found.multiplicities.tolist(), strict=True
    ):
        top = math.pi / loop.sample_time
        far = [
            min(abs(pole - root), abs(pole.conjugate() - root) if abs(root.imag) == top else 9e9)
            for pole in exact
        ]
        assert sum(distance <= radius for distance in far) == multiplicity


def test_poles_of_a_sampled_loop_in_a_region_are_its_eigenvalues():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(5.0), delay=0.36, sample_time=0.065)
    z = np.linalg.eigvals(loop.transition_matrix())
    inside = np.log(z[(np.abs(z) > np.exp(-10 * 0.065)) & (z.imag >= 0.0)]) / 0.065
    found = loop.poles(re=(-10, None), im=(0, None))
    np.testing.assert_allclose(np.sort_complex(found.roots), np.sort_complex(inside), rtol=1e-9)
    assert found.counted == len(inside) > 1
    assert loop.count(re=(0, None)) == np.count_nonzero(np.abs(z) > 1.0) == 2
    assert loop.count() == np.count_nonzero(z)


def test_the_rightmost_poles_of_a_sampled_loop_name_the_strip_they_were_sought_in():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(5.0), delay=0.36, sample_time=0.065)
    found = loop.rightmost(2)
    half = math.pi / 0.065
    assert found.region == ((found.roots.real.min(), math.inf), (-half, half))


def test_a_pole_of_a_sampled_loop_on_the_edge_is_refused():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(5.0), delay=0.36, sample_time=0.065)
    pole = loop.rightmost().roots[0]
    with pytest.raises(dtm.ContourError, match="edge") as refused:
        loop.count(re=(pole.real, None))
    assert refused.value.place == pole
    assert refused.value.inside == 0
    with pytest.raises(ValueError, match="lower end is below"):
        loop.count(re=(1, 0))
    with pytest.raises(ValueError, match="finitely many"):
        loop.certify(re=(0, None))


def test_a_continuous_loop_answers_as_its_characteristic_function():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.PV(2.0, 0.3), delay=0.36)
    h = loop.characteristic()
    region = {"re": (-12, 2), "im": (0, 100)}
    assert loop.count(**region) == h.count(**region) == loop.certify(**region).count
    np.testing.assert_array_equal(loop.poles(**region).roots, h.roots(**region).roots)
    assert loop.crossings({"Kp": (0.1, 9)}).values == pytest.approx(
        [loop.stable_range("Kp")[1]], rel=1e-9
    )
    assert loop.is_stable() == loop.is_stable(strong=False) == h.is_stable()
    assert loop.spectral_abscissa(strong=False) == h.spectral_abscissa(strong=False)


#: Questions that a sampled loop answers.
ASKED = {
    "is_stable": lambda loop: loop.is_stable(),
    "rightmost": lambda loop: loop.rightmost(),
    "spectral_abscissa": lambda loop: loop.spectral_abscissa(),
    "count": lambda loop: loop.count(re=(0, 1)),
    "poles": lambda loop: loop.poles(re=(-1, 0)),
    "margin": lambda loop: loop.margin(),
    "stable_range": lambda loop: loop.stable_range("Kp"),
    "transition_matrix": lambda loop: loop.transition_matrix(),
    "simulate": lambda loop: loop.simulate([0.0, 1.0]),
    "map": lambda loop: dtm.stability_map(loop, {"Kp": (0.5, 2), "gain": (0.5, 1)}, (3, 3)),
    "map over delays": lambda loop: dtm.stability_map(
        loop, {"Kp": (0.5, 2), "delay": (0.5, 1)}, (3, 3)
    ),
}


@pytest.mark.parametrize("sample_time", [1e-17, 1e-20, 1e-300])
@pytest.mark.parametrize("asked", ASKED)
def test_a_delay_of_more_samples_than_doubles_count_is_refused(asked, sample_time):
    # An abscissa of 0, and no stable margin: the count of samples had wrapped at 2^63.
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=1.0, sample_time=sample_time)
    with pytest.raises(ValueError, match="too many to count in double precision"):
        ASKED[asked](loop)
