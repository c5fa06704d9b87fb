"""Derivatives of roots, against differences at high precision, and closed forms."""

import json
import math
from pathlib import Path

import deadtime as dtm
import mpmath as mp
import numpy as np
import pytest
from deadtime import delay, s
from hypothesis import given, strategies as st

CASES = {
    case["name"]: case
    for case in json.loads(
        (Path(__file__).parents[1] / "reference" / "root_cases.json").read_text(encoding="utf-8")
    )["cases"]
}
NAMES = ["armah_K2", "qpmr_ex3_neutral", "humphries_k3", "lambertw_yi", "peec", "tdscontrol_2.9"]


def moved(coefficients, delays, root):
    """The root near `root`, at 60 digits."""

    def h(z):
        return mp.fsum(
            mp.fsum(mp.mpf(c) * z**k for k, c in enumerate(row)) * mp.exp(-z * tau)
            for row, tau in zip(coefficients, delays, strict=True)
        )

    return mp.findroot(h, mp.mpc(root), tol=1e-50)


def slope(change, root):
    """Central difference of the root of the function that `change(step)` returns; error 1e-24."""
    with mp.workdps(60):
        step = mp.mpf(10) ** -12
        up, down = (moved(*change(sign * step), root) for sign in (1, -1))
        return complex((up - down) / (2 * step))


@pytest.mark.parametrize("name", NAMES)
def test_every_derivative_agrees_with_differences_at_sixty_digits(name):
    case = CASES[name]
    h = dtm.QuasiPolynomial(case["coefs"], case["delays"])
    for root in (h.rightmost()[0], complex(*case["roots"][len(case["roots"]) // 2][:2])):
        found = h.root_sensitivity(root)
        assert abs(found.root - root) < 1e-11 * abs(root)
        assert found.coefficients.shape == h.coefficients.shape
        rows, times = h.coefficients.tolist(), h.delays.tolist()

        def coefficient(step, j, k, rows=rows, times=times):
            new = [[mp.mpf(c) for c in row] for row in rows]
            new[j][k] += step
            return new, times

        def time(step, j, rows=rows, times=times):
            return rows, [mp.mpf(t) + (step if i == j else 0) for i, t in enumerate(times)]

        with mp.workdps(60):
            for j in range(len(times)):
                wanted = slope(lambda step, j=j: time(step, j), root)
                assert abs(found.delays[j] - wanted) <= 1e-9 * max(abs(wanted), abs(root) * 1e-3)
                for k in range(h.degree + 1):
                    wanted = slope(lambda step, j=j, k=k: coefficient(step, j, k), root)
                    assert abs(found.coefficients[j, k] - wanted) <= 1e-9 * abs(wanted)


@given(st.floats(0.1, 4.0), st.floats(0.05, 2.0))
def test_the_scalar_equation_moves_as_its_closed_form(gain, time):
    # s e^(sT) = -K: ds/dK = s / (K (1 + sT)), ds/dT = -s^2 / (1 + sT).
    if abs(gain * time - math.exp(-1)) < 1e-3:
        return  # the double root
    K, T = dtm.parameters("K T")
    root = (s + gain * delay(time)).rightmost()[0]
    found = (s + K * delay(T)).root_sensitivity(root, at={"K": gain, "T": time})
    assert found["K"] == pytest.approx(root / (gain * (1 + root * time)), rel=1e-10)
    assert found["T"] == pytest.approx(-(root**2) / (1 + root * time), rel=1e-10)


def test_parameters_in_products_powers_sums_of_delays_and_rows_that_vanish():
    a, b, T = dtm.parameters("a b T")
    family = s**2 + a**2 * b * s + (a - 2) * s * delay(T) + 3 * delay(2 * T + 0.1) + b * delay(0.5)
    point = {"a": 2.0, "b": 0.7, "T": 0.2}  # one row is zero there, two delays agree
    root = family.at(**point).rightmost()[0]
    found = family.root_sensitivity(root, at=point)
    for name, value in point.items():
        step = 1e-5

        def at(x, name=name):
            h = family.at(**{**point, name: x})
            return h.root_sensitivity(root).root

        wanted = (at(value + step) - at(value - step)) / (2 * step)
        # A central difference in double precision: 1e-10 + 1e-16 / 1e-5.
        assert found[name] == pytest.approx(wanted, rel=1e-8)


def test_nothing_overflows_far_to_the_left():
    h = s + 2.0 * delay(0.36)
    root = h.roots(re=(-60, -30), im=(1e5, 1e5 + 40))[0]
    found = h.root_sensitivity(root)
    # ds/dK = s / (K (1 + sT))
    assert found.coefficients[1, 0] == pytest.approx(root / (2 * (1 + 0.36 * root)), rel=1e-12)
    late = dtm.QuasiPolynomial([[1.0, 1.0], [0.9, 0.0]], [0.0, 1000.0])
    assert np.isfinite(late.root_sensitivity(late.rightmost()[0]).coefficients).all()


def test_lower_roots_are_the_mirror_image():
    h = s + 2.0 * delay(0.36)
    root = h.rightmost()[0]
    up, down = h.root_sensitivity(root), h.root_sensitivity(root.conjugate())
    np.testing.assert_array_equal(up.coefficients.conj(), down.coefficients)
    np.testing.assert_array_equal(up.delays.conj(), down.delays)


@pytest.mark.parametrize(
    ("h", "root", "many"),
    [
        (s - 1 + delay(1.0), 0.0, 2),
        ((s + delay(1.0)) ** 2, -0.3181315052047641 + 1.3372357014306895j, 2),
        (dtm.QuasiPolynomial([[6, -4, 1], [-6, -2, 0]], [0, 1]), 0.0, 4),
        (s**3, 0.0, 3),
    ],
)
def test_a_multiple_root_is_refused_with_its_multiplicity(h, root, many):
    with pytest.raises(ValueError, match=f"not simple: .*separate {many} roots"):
        h.root_sensitivity(root)


def test_what_is_no_root_is_refused():
    h = s + 2.0 * delay(0.36)
    for place in (1.0, 100j, -1.5):
        with pytest.raises(ValueError, match="not a root"):
            h.root_sensitivity(place)
    with pytest.raises(ValueError, match="finite"):
        h.root_sensitivity(math.nan)
    K, T = dtm.parameters("K T")
    with pytest.raises(ValueError, match="T has no value"):
        (s + K * delay(T)).root_sensitivity(1j, at={"K": 1.0})
