"""Quasi-polynomials with named parameters."""

import copy
import pickle
from fractions import Fraction

import deadtime as dtm
import numpy as np
import pytest
from deadtime import delay, s
from hypothesis import given, strategies as st

Kp, Kv, T = dtm.parameters("Kp Kv T")
NAMES = ("Kp", "Kv", "T")


def test_parameters_are_split_at_spaces_and_commas():
    assert [p.name for p in dtm.parameters("a, b  c,d")] == ["a", "b", "c", "d"]
    (single,) = dtm.parameters("Kp")
    assert isinstance(single, dtm.roots.Parameter)
    assert single == Kp
    assert hash(single) == hash(Kp)
    assert single != Kv


@pytest.mark.parametrize("names", ["", " , ", "2x", "a-b", "lambda", "s", "Kp T Kp"])
def test_bad_names_are_refused(names):
    with pytest.raises(ValueError, match=r"name|variable|twice"):
        dtm.parameters(names)


def test_names_in_anything_but_a_string_are_refused():
    with pytest.raises(TypeError, match="one string"):
        dtm.parameters(["Kp", "T"])


def test_numbers_are_put_where_the_parameters_were():
    h = s**2 + (Kp + Kv * s) * delay(T)
    assert isinstance(h, dtm.roots.ParametricQuasiPolynomial)
    assert h.names == NAMES
    assert h.at(Kp=2, Kv=np.float64(0.3), T=Fraction(1, 4)) == s**2 + (2 + 0.3 * s) * delay(0.25)
    assert h.at(Kp=2, Kv=0.3, T=0) == s**2 + 0.3 * s + 2


def test_names_keep_the_order_of_their_first_appearance():
    assert (T + Kv * Kp).names == ("T", "Kv", "Kp")
    # A parameter that cancels is still one of the function's.
    assert (Kp * s - Kp * s + T).names == ("Kp", "T")
    assert (Kp * s - Kp * s + T).at(Kp=1, T=2) == dtm.QuasiPolynomial([[2.0]], [0.0])


@pytest.mark.parametrize(
    ("given_", "text"),
    [
        (s + (Kp + Kv * s) * delay(0.36), "s + (Kp + Kv s) exp(-0.36 s)"),
        (s - Kp * delay(2 * T + 0.1), "s - Kp exp(-(2 T + 0.1) s)"),
        (-(Kp**2) * delay(T) + 1, "1 - Kp^2 exp(-T s)"),
        (Kp - Kp, "0"),
        (delay(0.5 - T), "exp(-(-T + 0.5) s)"),
        (Kp, "Kp"),
        (delay(T) * delay(T + Kp), "exp(-(Kp + 2 T) s)"),
    ],
)
def test_it_reads_like_algebra(given_, text):
    assert repr(given_) == text


def test_delays_are_affine_in_the_parameters():
    h = 1 + delay(2 * T + 0.1) * delay(Kp)
    np.testing.assert_array_equal(h.at(T=0.25, Kp=1.0).delays, [0.0, 1.6])
    for bad in (T * Kp, T**2, s * T, T * delay(0.1), T + s):
        with pytest.raises(ValueError, match="sum of parameters"):
            delay(bad)


@pytest.mark.parametrize("fixed", [{"Kp": 1.7}, {"T": 0.3}, {"Kv": 0.2, "T": 0.3}, {}])
def test_some_values_leave_a_family(fixed):
    h = s**2 + (Kp**2 + Kv * s) * delay(2 * T + 0.1) + Kp * Kv * delay(T)
    point = {"Kp": 1.7, "Kv": 0.2, "T": 0.3}
    part = h.at(**fixed)
    assert part.names == tuple(name for name in h.names if name not in fixed)
    whole = part.at(**{name: value for name, value in point.items() if name not in fixed})
    np.testing.assert_allclose(whole.coefficients, h.at(**point).coefficients, rtol=1e-15)
    np.testing.assert_allclose(whole.delays, h.at(**point).delays, rtol=1e-15)


def test_numbers_in_place_of_some_parameters_read_like_numbers():
    h = s**2 + (Kp**2 + Kv * s) * delay(T) + Kp * Kv * s * delay(T)
    assert repr(h.at(Kp=2.0)) == "s^2 + (4 + 3 Kv s) exp(-T s)"
    assert h.at(Kp=2.0).at(T=0.5) == h.at(T=0.5, Kp=2.0) == s**2 + (4 + 3 * Kv * s) * delay(0.5)


def test_negative_delays_are_refused_where_they_arise():
    h = s + delay(T - 0.1)
    with pytest.raises(ValueError, match=r"T=0\.05.*not be negative"):
        h.at(T=0.05)
    # 0.3 - 0.1 - 0.1 - 0.1 is below zero by rounding alone.
    assert (s + delay(0.3 - 3 * T)).at(T=0.1) == s + 1
    assert (Kp + delay(0.3 - 3 * T)).at(T=0.1) == Kp + 1
    with pytest.raises(ValueError, match=r"T=0\.05.*not be negative"):
        (Kp + delay(T - 0.1)).at(T=0.05)


def test_a_parameter_does_not_divide():
    for quotient in (
        lambda: s / T,
        lambda: 1 / T,
        lambda: Kp / T,
        lambda: Kp / s,
        lambda: (s + Kp) / (s + T),
    ):
        with pytest.raises(TypeError, match="Multiply the equation by this divisor"):
            quotient()
    assert (Kp + s) / 2 == 0.5 * Kp + 0.5 * s
    with pytest.raises(ZeroDivisionError):
        Kp / 0
    with pytest.raises(ValueError, match="finite"):
        Kp / np.nan


def test_powers_are_whole():
    assert (s + Kp) ** 2 == s**2 + 2 * Kp * s + Kp**2
    assert Kp**0 == 1 + 0 * Kp
    with pytest.raises(ValueError, match="multiply the equation by the divisor"):
        Kp**-1
    with pytest.raises(TypeError):
        Kp**0.5


@pytest.mark.parametrize("foreign", ["2", None, 1j, [1.0], np.ones(2)])
def test_foreign_operands_are_refused(foreign):
    with pytest.raises(TypeError):
        Kp + foreign
    with pytest.raises(TypeError):
        foreign * Kp


def test_bad_numbers_are_refused():
    with pytest.raises(ValueError, match="finite"):
        Kp + np.inf
    with pytest.raises(ValueError, match="finite"):
        Kp * 1e200 * 1e200
    with pytest.raises(ValueError, match="more than"):
        (s + Kp + Kv + T) ** 500


def test_values_are_checked():
    h = s + Kp * delay(T)
    with pytest.raises(ValueError, match=r"Kd.*Kp, T"):
        h.at(Kp=1, T=1, Kd=2)
    with pytest.raises(ValueError, match="finite"):
        h.at(Kp=np.nan, T=1)
    with pytest.raises(TypeError, match="number"):
        h.at(Kp="one", T=1)


def test_it_is_made_by_algebra_and_does_not_change():
    with pytest.raises(TypeError, match="by algebra"):
        dtm.roots.ParametricQuasiPolynomial()
    with pytest.raises(AttributeError, match="cannot be changed"):
        Kp._names = ("x",)
    h = s + Kp * delay(T)
    for twin in (copy.deepcopy(h), pickle.loads(pickle.dumps(h)), Kp * delay(T) + s):
        assert twin == h
        assert hash(twin) == hash(h)
    assert pickle.loads(pickle.dumps(Kp)).name == "Kp"
    assert h != s + Kp * delay(Kv)
    assert h != 1


# An expression is a tree; it is evaluated with parameters, with numbers in their place, and with
# the moduli of everything, which says what rounding is relative to.
numbers = st.floats(-3, 3).map(lambda x: round(x, 3))
affine = st.tuples(
    st.floats(0, 1), st.dictionaries(st.sampled_from(NAMES), st.floats(0, 2), max_size=2)
)
leaves = st.one_of(
    st.tuples(st.just("number"), numbers),
    st.tuples(st.just("name"), st.sampled_from(NAMES)),
    st.tuples(st.just("s")),
    st.tuples(st.just("delay"), affine),
)
trees = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.tuples(st.sampled_from("+-*"), inner, inner),
        st.tuples(st.just("^"), inner, st.integers(0, 3)),
        st.tuples(st.just("neg"), inner),
    ),
    max_leaves=8,
)


def evaluate(tree, names, leaf):
    match tree:
        case ("number", x):
            return leaf["number"](x)
        case ("name", name):
            return names[name]
        case ("s",):
            return leaf["s"]
        case ("delay", (constant, slopes)):
            return leaf["delay"](sum((q * names[n] for n, q in slopes.items()), constant))
        case ("neg", a):
            return leaf["neg"](evaluate(a, names, leaf))
        case ("^", a, n):
            return evaluate(a, names, leaf) ** n
        case (sign, a, b):
            a, b = evaluate(a, names, leaf), evaluate(b, names, leaf)
            return a * b if sign == "*" else leaf[sign](a, b)


EXACT = {
    "number": float,
    "s": s,
    "delay": delay,
    "neg": lambda a: -a,
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
}


def moduli(omega, depth):
    """Leaves that bound the size of all intermediate terms at s = j omega."""
    return {
        "number": abs,
        "s": omega,
        "delay": lambda T: 1.0 + T * omega * depth,
        "neg": lambda a: a,
        "+": lambda a, b: a + b,
        "-": lambda a, b: a + b,
    }


@given(trees, st.tuples(*[st.floats(0, 2)] * 3), st.floats(0, 5))
def test_algebra_then_numbers_is_numbers_then_algebra(tree, point, omega):
    values = dict(zip(NAMES, point, strict=True))
    family = 0 * (Kp + Kv + T) + evaluate(tree, dict(zip(NAMES, (Kp, Kv, T), strict=True)), EXACT)
    first = family.at(**values)
    then = 0 * s + evaluate(tree, values, EXACT)
    size = evaluate(tree, values, moduli(omega, 8)) + 1e-300
    # A few hundred roundings at most.
    assert abs(first(1j * omega) - then(1j * omega)) <= 1e-13 * size
