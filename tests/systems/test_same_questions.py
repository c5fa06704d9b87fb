"""A quasi-polynomial, a transfer function and a system answer the same questions alike."""

import inspect
import math

import deadtime as dtm
import numpy as np
import pytest
from deadtime import delay, s

H = s + (2.0 + 0.3 * s) * delay(0.36)
T = dtm.TransferFunction(1.0, H)
SYSTEM = dtm.DelaySystem({0.36: -2.0}, {0.0: 1.0}, N={0.36: 0.3})
LARGE = dtm.DelaySystem({0.36: -2.0 * np.eye(12)}, {0.0: np.eye(12)}, N={0.36: 0.3 * np.eye(12)})

QUESTIONS = {
    "count": lambda one: one.count(re=(-5, 1), im=(0, 40)),
    "poles": lambda one: (one.roots if one is H else one.poles)(re=(-5, 1), im=(0, 40)),
    "rightmost": lambda one: one.rightmost(2),
    "spectral_abscissa": lambda one: one.spectral_abscissa(),
    "spectral_abscissa, exact": lambda one: one.spectral_abscissa(strong=False),
    "chain_abscissa": lambda one: one.chain_abscissa(strong=True),
    "is_stable": lambda one: one.is_stable(strong=True),
    "is_stable, exact": lambda one: one.is_stable(strong=False),
    "certify": lambda one: one.certify(re=(-1, 1), im=(0, 20)).verify(),
}


@pytest.mark.parametrize("ask", QUESTIONS.values(), ids=QUESTIONS)
def test_all_of_them_answer_alike(ask):
    answers = [ask(one) for one in (H, T, SYSTEM)]
    if isinstance(answers[0], float):
        np.testing.assert_allclose(answers, answers[0], rtol=1e-9)
    else:
        assert all(np.allclose(np.asarray(one), np.asarray(answers[0])) for one in answers)


def test_the_questions_have_the_same_arguments():
    for name in ("count", "certify", "rightmost", "spectral_abscissa", "is_stable"):
        first = inspect.signature(getattr(type(H), name)).parameters
        for kind in (dtm.TransferFunction, dtm.DelaySystem):
            assert list(inspect.signature(getattr(kind, name)).parameters) == list(first)


def test_poles_on_the_edge_of_a_region():
    oscillator = dtm.TransferFunction([1.0], [1.0, 0.0, 4.0])
    region = {"re": (0, 1), "im": (0, 3)}
    assert oscillator.count(**region, edge="inside") == 1
    assert len(oscillator.poles(**region, edge="outside")) == 0


def test_what_needs_an_expanded_determinant_says_so():
    assert LARGE.count(re=(-5, 1), im=(0, 40)) == 12 * H.count(re=(-5, 1), im=(0, 40))
    assert LARGE.spectral_abscissa(strong=False) == pytest.approx(H.spectral_abscissa(), abs=1e-6)
    with pytest.raises(ValueError, match="expanded determinant"):
        LARGE.certify(re=(-1, 1), im=(0, 20))
    ring = np.roll(np.eye(12), 1, axis=0)
    chains = dtm.DelaySystem({1.0: -np.eye(12)}, N={0.5: 0.6 * ring, 1.0: -0.7 * np.eye(12)})
    with pytest.raises(ValueError, match="strong=False"):
        chains.chain_abscissa(strong=False)


def test_exact_delays_may_be_stable_where_strong_stability_is_not():
    h = s - 0.25 + (1 / 3 - 0.75 * s) * delay(1.0) + 0.5 * s * delay(2.0)
    system = dtm.DelaySystem(
        {0.0: 0.25, 1.0: -1 / 3, 2.0: 0.0}, {0.0: 1.0}, N={1.0: -0.75, 2.0: 0.5}
    )
    for one in (h, 1.0 / h, system):
        assert one.is_stable(strong=False)
        assert not one.is_stable()
        assert one.spectral_abscissa(strong=False) == pytest.approx(-0.1701, abs=1e-4)
        assert one.spectral_abscissa() == pytest.approx(0.1616, abs=1e-4)
        assert one.chain_abscissa(strong=False) == pytest.approx(-0.3466, abs=1e-4)


def test_margins_are_those_of_the_loop_gain():
    loop = 2.0 / s * delay(0.36)
    plant = dtm.DelaySystem(0.0, {0.36: 2.0})
    found = [(s + 2.0 * delay(0.36)).margin(), loop.margin(), plant.margin()]
    for one in found:
        assert one.delay_margin == pytest.approx(math.pi / 4 - 0.36, abs=1e-14)
        assert one.gain_margin == pytest.approx(0.25 * math.pi / 0.36, rel=1e-14)
    assert dtm.delay_margin(s + 2.0 * delay(0.36)) == found[0].delay_margin


def test_crossings_of_gain_and_delay():
    loop = 1.0 / s * delay(0.36)
    limit = 0.5 * math.pi / 0.36
    assert loop.crossings({"gain": (0.1, 10)}).values[0] == pytest.approx(limit, rel=1e-13)
    later = loop.crossings({"delay": (0, 2)}, at={"gain": 2.0})
    assert later.values[0] == pytest.approx(math.pi / 4 - 0.36, rel=1e-13)
    same = (s + 2.0 * delay(0.36)).crossings({"delay": (0, 2)})
    np.testing.assert_array_equal(same.values, later.values)
    least = dtm.DelaySystem({0.36: -2.0}).crossings({"delay": (0.1, 1)})
    assert least.values[0] == pytest.approx(math.pi / 4, rel=1e-13)
    chart = dtm.stability_map(loop, {"gain": (0.1, 6), "delay": (0, 0.5)}, (5, 4))
    assert chart.stable[0].all()
    assert not chart.stable[-1].any()
    with pytest.raises(ValueError, match="'gain'"):
        loop.crossings({"Kp": (0, 1)})


def test_the_sensitivity_is_that_of_the_closed_loop():
    G = 2.0 / s * delay(0.36)
    points = 1j * np.array([0.1, 1.0, 3.0])
    np.testing.assert_allclose(G.sensitivity()(points), 1.0 / (1.0 + G(points)), rtol=1e-14)


def test_a_delay_beside_the_coefficients():
    assert dtm.TransferFunction([2.0], [1.0, 0.0], delay=0.36) == 2.0 / s * delay(0.36)
    with pytest.raises(ValueError, match="delay"):
        dtm.TransferFunction([2.0], [1.0, 0.0], delay=-0.1)
