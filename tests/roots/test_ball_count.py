"""The count in ball arithmetic against known counts, and the package against ball arithmetic."""

import json
import math
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from ball_count import BallCounter, OnContourError, TooManyPiecesError, precision
from ball_survey import Package, examine
from flint import arb
from hard_functions import KINDS, hard_function

CASES = {
    case["name"]: case
    for case in json.loads(
        (Path(__file__).parents[1] / "reference" / "root_cases.json").read_text(encoding="utf-8")
    )["cases"]
}

# Real roots that are twofold, or too close together for signs: the real axis cannot be counted.
TOUCHING_THE_AXIS = {"double_at_0", "mid_mult4_exact0"}


def loop(a, T):
    return BallCounter([[0.0, 1.0], [a, 0.0]], [0.0, T])


def branches(a, T, n=150):
    """The roots of s + a e^(−sT): W_k(−aT)/T."""
    with mp.workdps(30):
        return [complex(mp.lambertw(-mp.mpf(a) * mp.mpf(T), k) / T) for k in range(-n, n + 1)]


# The counter itself


@pytest.mark.parametrize("name", CASES)
def test_certified_counts(name):
    case = CASES[name]
    counter = BallCounter(case["coefs"], case["delays"])
    a, b, c, d = case["region"]
    if name == "on_contour":
        with pytest.raises(OnContourError) as error:
            counter.rectangle((a, b), (-d, d))
        assert abs(abs(error.value.place.imag) - 2) < 1e-12
        return
    full = (-d, d) if c == 0 else (c, d)
    assert counter.rectangle((a, b), full) == case["certified_winding_count"]
    if name in TOUCHING_THE_AXIS:
        counter.max_pieces = 3000
        with pytest.raises((OnContourError, TooManyPiecesError)):
            counter.upper_rectangle((a, b), d)
    elif c == 0:
        assert counter.upper_rectangle((a, b), d) == case["count_region_upper_closed"]


@pytest.mark.parametrize("a", [-3.0, -0.2, 0.1, 0.9, 5.0])
@pytest.mark.parametrize("T", [0.05, 1.0, 7.0])
def test_branches_of_lambert_w(a, T):
    roots = branches(a, T)
    rng = np.random.default_rng(3)
    for _ in range(5):
        x = np.sort(rng.uniform(-5, 3, 2)) / T
        y = np.sort(rng.uniform(-100, 100, 2)) / T
        inside = [z for z in roots if x[0] < z.real < x[1] and y[0] < z.imag < y[1]]
        assert loop(a, T).rectangle(x.tolist(), y.tolist()) == len(inside)
        sigma = rng.uniform(-3, 3) / T
        assert loop(a, T).right_of(sigma) == sum(z.real > sigma for z in roots)
    real = sum(z.imag == 0 for z in roots)
    assert loop(a, T).real((-100.0 / T, 20.0 / T)) == real


def test_planted_roots_and_their_neighbourhood():
    """Edges whose distance from a root is 1e-40 of its size, far below the spacing of doubles."""
    counter = BallCounter([np.poly([1.0, 1.0, -2.0])[::-1]], [0.0])
    with precision(200):
        right, left = arb(1) + arb(2) ** -133, arb(1) - arb(2) ** -133
    assert counter.rectangle((0.5, right), (-1.0, 1.0)) == 2
    assert counter.rectangle((0.5, left), (-1.0, 1.0)) == 0
    assert counter.rectangle((-3.0, 3.0), (-1.0, arb(2.0) ** -100)) == 3
    assert counter.disc(1.0 + 0.0j, 1e-30) == 2
    assert counter.disc(1.0 + 1e-20j, 1e-21, sides=32) == 0
    with pytest.raises(OnContourError):
        counter.rectangle((0.5, 1.0), (-1.0, 1.0))


def test_powers_of_s_on_the_real_axis():
    """s³ (s + e^(−s/3)): roots of two sizes, one of them exact and threefold."""
    counter = BallCounter([[0, 0, 0, 0, 1.0], [0, 0, 0, 1.0, 0]], [0.0, 1 / 3])
    roots = sum(z.imag == 0 and -9 < z.real < 1 for z in branches(1.0, 1 / 3))
    assert counter.real((-9.0, 1.0)) == 3 + roots
    assert counter.real((-9.0, -1e-9)) == roots
    assert counter.upper_rectangle((-9.0, 1.0), 0.5) == 3 + roots


def test_the_counter_does_not_overflow():
    big = BallCounter([[0.0, 1e200], [1e-190, 0.0]], [0.0, 1e-3])
    assert big.rectangle((-2e6, 1.0), (-1e4, 1e4)) == 4
    assert loop(1.0, 1.0).rectangle((-1e5, 1.0), (-30.0, 30.0)) == 10


def test_bounds_of_half_planes():
    neutral = BallCounter([[2.0, 1.0], [0.0, 0.5]], [0.0, 1.0])
    with pytest.raises(ValueError, match="chains"):
        neutral.outermost(-0.7)
    radius = neutral.outermost(-0.5)
    assert neutral.right_of(-0.5) == neutral.rectangle((-0.5, 3.0), (-9.0 * radius, 9.0 * radius))
    # A polynomial: all its roots, and none right of them.
    assert BallCounter([[6.0, 5.0, 1.0]], [0.3]).right_of(-2.5) == 1
    assert BallCounter([[6.0, 5.0, 1.0]], [0.3]).right_of(-3.5) == 2
    assert BallCounter([[7.0]], [0.0]).right_of(-1.0) == 0


def test_the_condition_is_that_of_the_sum():
    counter = BallCounter(np.poly([1.0] * 4)[None, ::-1], [0.0])
    assert counter.condition(2.0) == pytest.approx(81.0)
    assert loop(1.0, 2.0).condition(1j) == pytest.approx(2 / abs(1j + np.exp(-2j)))


def test_budgets_and_zero():
    with pytest.raises(ValueError, match="zero"):
        BallCounter([[0.0]], [1.0])
    with pytest.raises(TooManyPiecesError):
        BallCounter([[0.0, 1.0], [1.0, 0.0]], [0.0, 1.0], max_pieces=5).rectangle(
            (-9.0, 1.0), (-99.0, 99.0)
        )


# The generator


def test_cases_are_reproducible_and_of_every_kind():
    cases = [hard_function(2, k) for k in range(200)]
    assert cases == [hard_function(2, k) for k in range(200)]
    assert cases != [hard_function(3, k) for k in range(200)]
    assert {case.kind for case in cases} == set(KINDS)
    for case in cases:
        assert 1 <= len(case.delays) <= 14
        assert len(case.coefficients[0]) <= 15
        assert np.isfinite(case.coefficients).all()
        assert case.re[0] < case.re[1]
        assert case.im[0] < case.im[1]


# The package

# Where double precision leaves nothing of h: each of up to 60 roundings is bounded by the sum of
# moduli times 2⁻⁵³, and a quarter of |h| must remain.
DROWNED = 1e12


@pytest.mark.parametrize(
    "number",
    [
        *(k for k in range(30) if k not in (21, 23)),  # each as long as all others together
        *(pytest.param(k, marks=pytest.mark.survey) for k in (21, 23, *range(30, 60))),
        *(pytest.param(k, marks=[pytest.mark.survey, pytest.mark.long]) for k in range(60, 120)),
    ],
)
def test_hard_cases_have_the_count_of_ball_arithmetic(number):
    """No wrong count; refusals only where a root is, or where rounding exceeds the value."""
    verdicts, places = examine(hard_function(2, number), Package())
    assert verdicts
    for question, verdict in verdicts.items():
        assert not verdict.startswith("wrong"), (question, verdict)
        if verdict == "refused clear":
            assert float(places[question].split()[-1]) > DROWNED, (question, places[question])


def test_a_wrong_answer_would_be_noticed():
    """The comparison on a package that is off by one root."""
    case = next(case for k in range(50) if (case := hard_function(2, k)).kind == "retarded")

    class OffByOne(Package):
        def __call__(self, ask):
            given = super().__call__(ask)
            return given + 1 if isinstance(given, int) else given

    verdicts, _ = examine(case, OffByOne())
    assert verdicts["count"].startswith("wrong")
    assert verdicts["half plane"].startswith("wrong")
    assert math.isfinite(case.line)
