"""The asymptotic laws of chains of roots, against the roots themselves."""

import math

import deadtime as dtm
import numpy as np
import pytest
from deadtime import delay, s
from deadtime.gallery import _access as gallery

SYSTEMS = {
    "scalar": s + 2.0 * delay(0.36),
    "negative gain": s - 2.0 * delay(0.36),
    "neutral": s + (2.0 + 0.3 * s) * delay(0.36),
    "two bends": s**3 + s**2 * delay(1.0) + 5.0 * delay(1.7),
    "commensurate edge": s**2 * (1.0 - 0.75 * delay(1.0) + 0.5 * delay(2.0)) + s + 1.0,
    "edge of slope": s**2 + 0.5 * s * delay(1.0) + 3.0 * delay(2.0),
    "advanced": 1.0 + s**2 * delay(0.5),
    "incommensurate edge": s * (1.0 + 0.4 * delay(1.0) + 0.3 * delay(math.sqrt(2))) + 1.0,
    "late": (s + 1.0) * delay(0.3) + 2.0 * delay(1.0),
    "inner point": s**2 + 0.1 * delay(0.5) + delay(1.0) + s * delay(0.2),
    **{p.key: p.h for p in gallery.problems()},
}

#: Two chains bend almost alike: |s|^-0.05 falls late, and far below that the starts are only near.
ALIKE = {"vyhlidal2009", "vyhlidal2014-3"}
#: Where the laws begin to hold, if coefficients of the lower powers are large.
FIRST = {"bellen1999": 10**6}


def newton(h, z):
    slope = h.derivative()
    for _ in range(50):
        step = h(z) / slope(z)
        z = z - step
        if abs(step) <= 1e-15 * abs(z):
            break
    return z


@pytest.mark.parametrize("name", SYSTEMS)
def test_every_far_start_leads_to_a_root_of_its_own(name):
    h = SYSTEMS[name]
    ends, reach = [], []
    first = FIRST.get(name, 300)
    for chain in h.chains():
        n = np.arange(first, first + 12)
        if chain.multiplicity > 1:
            continue  # roots at the distance of a power of 1/|s| from each other: no start is near
        if name in ALIKE:
            for z in chain.starts(n).tolist():
                (re, im), far = (z.real, z.imag), 0.5 * chain.spacing
                found = h.roots(re=(re - far, re + far), im=(im - far, im + far))
                assert min(abs(found.roots - z)) < far
            continue
        for z in chain.starts(n):
            root = newton(h, complex(z))
            assert abs(newton(h, root) - root) <= 1e-12 * abs(root)
            ends.append(root)
            reach.append(abs(root - z))
    if not ends:
        return
    assert max(reach) < 0.5 * min(chain.spacing for chain in h.chains())
    apart = np.abs(np.subtract.outer(ends, ends))[~np.eye(len(ends), dtype=bool)]
    assert apart.min() > 1e-6


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_chains_hold_all_roots_of_a_tall_box(name):
    h = SYSTEMS[name]
    low, high = 200.0, 600.0
    chains = h.chains()
    edges = np.concatenate([chain.real_part([low, high]) for chain in chains])
    box = {"re": (edges.min() - 8.0, edges.max() + 8.0), "im": (low, high)}
    number = h.count(**box)
    told = 0
    for chain in chains:
        n = np.arange(int(high / chain.spacing * 1.2) + 30)
        heights = chain.starts(n).imag
        told += chain.multiplicity * np.count_nonzero((heights > low) & (heights < high))
    assert abs(number - told) <= 2 * len(chains)


def test_the_scalar_chain_is_the_closed_form():
    # s e^(0.36 s) = -2: the branches of Lambert's function.
    (chain,) = (s + 2.0 * delay(0.36)).chains()
    assert (chain.kind, chain.periodic, chain.multiplicity) == ("retarded", True, 1)
    assert chain.bend == pytest.approx(1 / 0.36)
    exact = dtm.lambertw(-0.72, np.arange(0, 2000)) / 0.36
    np.testing.assert_allclose(chain.starts(np.arange(2000)), exact, rtol=1e-14)
    np.testing.assert_allclose(chain.real_part(exact.imag[5:]), exact.real[5:], rtol=1e-12)


def test_an_edge_that_is_almost_straight_has_the_starts_of_the_straight_one():
    # Points within 1e-9 of an edge lie on it, and then its delays have no common base: roots of
    # the difference part are counted from where Im s = 0, half a turn of mu up.
    straight, almost = (
        s**2 - 0.5 * s * delay(1.0 + off) + 3.0 * delay(2.0) for off in (0.0, 2e-10)
    )
    (one,) = almost.chains()
    assert not one.periodic
    assert one.bend == pytest.approx(1.0)
    n = np.arange(30)
    expected = np.concatenate([chain.starts(n) for chain in straight.chains()])
    expected = expected[np.argsort(expected.imag)][: len(n)]
    np.testing.assert_allclose(one.starts(n), expected, rtol=1e-7)


def test_the_neutral_chain_runs_along_its_line():
    h = s + (2.0 + 0.3 * s) * delay(0.36)
    (chain,) = h.chains()
    assert (chain.kind, chain.bend) == ("neutral", 0.0)
    assert chain.offset == pytest.approx(h.chain_abscissa(), rel=1e-14)
    far = h.roots(re=(-4, -3), im=(9000, 9100))
    # Im s falls with 1/|s|, Re s with 1/|s|^2.
    assert np.abs(far.roots.real - chain.offset).max() < 1e-6
    assert np.abs(chain.real_part(0.0) - chain.offset) == 0


@pytest.mark.parametrize("system", ["matrices", "characteristic", "transfer function"])
def test_rightmost_roots_name_the_chains_that_leave_none(system):
    # exp(-0.5 v) = -1/1.1
    D = dtm.DelaySystem({0.0: [[-1]]}, N={0.5: [[1.1]]})
    h = D.characteristic()
    asked = {"matrices": D, "characteristic": h, "transfer function": 1 / h}[system]
    found = asked.rightmost()
    assert len(found) == 0
    assert found.chain_abscissa == pytest.approx(math.log(1.1) / 0.5)
    assert repr(found).endswith("\n  further left, chains of roots may approach re=0.19062")


def test_rightmost_roots_right_of_the_chains_do_not_name_them():
    h = s + (2.0 + 0.7 * s) * delay(0.36)
    assert h.rightmost().chain_abscissa == -math.inf
    assert "chains" not in repr(h.rightmost())
    assert (s + 1).rightmost(3).chain_abscissa == -math.inf
    assert repr((s + 1).rightmost(3)).startswith("RootSet: 1 root in ")


def test_a_double_chain_is_listed_once_with_its_multiplicity():
    chains = ((s + delay(1.0)) ** 2).chains()
    assert [chain.multiplicity for chain in chains] == [2]
    chains = (s * (1.0 + 0.5 * delay(1.0)) ** 2 + 1.0).chains()
    assert [chain.multiplicity for chain in chains] == [2]


def test_polynomials_have_no_chains():
    assert (s**3 + 1.0).chains() == ()
    assert dtm.QuasiPolynomial([[0.0]], [0.0]).chains() == ()


def test_bad_indices_are_refused():
    (chain,) = (s + delay(1.0)).chains()
    with pytest.raises(ValueError, match="numbered from 0"):
        chain.starts(-1)
    with pytest.raises(TypeError, match="whole numbers"):
        chain.starts(1.5)
    assert isinstance(chain.starts(3), complex)


def test_roots_are_drawn_with_their_chains():
    from matplotlib.figure import Figure

    h = s + 2.0 * delay(0.36)
    ax = Figure().subplots()
    found = h.roots(re=(-15, 2), im=(-300, 300))
    assert found.plot(ax, chains=h.chains()) is ax
    assert len(ax.lines) == 4  # the axis, the roots, the law above and below
    law = ax.lines[2]
    inside = np.interp(found.roots[10].imag, law.get_ydata(), law.get_xdata())
    assert abs(inside - found.roots[10].real) < 0.05
