"""Counts, discs and rightmost roots against the certified table of reference cases."""

import math

import mpmath as mp
import numpy as np
import pytest
from deadtime import delay, s
from deadtime._base.errors import ContourError
from root_cases import (
    CASES,
    CHAINS_LEAD,
    REGION_ONLY,
    ROOT_ON_AN_EDGE,
    ULP,
    make,
    region,
    symmetric,
)


@pytest.mark.parametrize("name", CASES)
def test_kind(name):
    assert make(CASES[name]).kind == CASES[name]["type"]


@pytest.mark.parametrize("name", CASES)
def test_count_of_the_certified_region(name):
    case = CASES[name]
    edge = "inside" if name in ROOT_ON_AN_EDGE else "error"
    assert make(case).count(**symmetric(case), edge=edge) == case["certified_winding_count"]


@pytest.mark.parametrize("name", CASES)
def test_count_of_the_upper_half(name):
    case = CASES[name]
    edge = "inside" if name in ROOT_ON_AN_EDGE else "error"
    assert make(case).count(**region(case), edge=edge) == case["count_region_upper_closed"]


@pytest.mark.parametrize("name", sorted(ROOT_ON_AN_EDGE))
def test_roots_on_the_edge_are_classified(name):
    h, where = make(CASES[name]), symmetric(CASES[name])
    for method in (h.count, h.roots):
        with pytest.raises(ContourError, match="the edge of the region touches") as error:
            method(**where)
        assert error.value.inside == 0
        for (center, radius, multiplicity), root in zip(
            sorted(error.value.on_edge, key=lambda disc: disc[0].imag), (-2j, 2j), strict=True
        ):
            assert abs(center - root) <= radius < 1e-13
            assert multiplicity == 1
    assert h.count(**where, edge="inside") == 2
    assert h.count(**where, edge="outside") == 0
    assert np.allclose(h.roots(**where, edge="inside"), [2j, -2j], rtol=0, atol=1e-14)
    assert len(h.roots(**where, edge="outside")) == 0
    # The error tells how far to move the edge.
    away = error.value.distance
    (a, b), im = where["re"], where["im"]
    assert h.count(re=(a - away, b), im=im) == 2
    assert h.count(re=(a + away, b), im=im) == 0
    with pytest.raises(ValueError, match='edge="both"'):
        h.count(**where, edge="both")


def test_an_edge_next_to_a_root_is_proved_in_double_double():
    """Double precision cannot prove an edge this close; double-double arithmetic does."""
    h = (s + 2) * (s + delay(1.0))
    root = -0.3181315052047641353 + 1.3372357014306894089j
    for gap in (1e-9, 1e-12, 1e-14):
        assert h.count(re=(root.real - gap, 1), im=(1, 2)) == 1
        assert h.count(re=(root.real + gap, 1), im=(1, 2)) == 0
    double = s - 1 + delay(1.0)
    assert double.count(re=(-1e-7, 1), im=(-1, 1)) == 2
    assert double.count(re=(1e-7, 1), im=(-1, 1)) == 0
    with pytest.raises(ContourError, match=r"0\.0\+0\.0i within 0\.0e0 \(2 roots\)") as error:
        double.count(re=(0, 1), im=(-1, 1))
    assert error.value.on_edge == [(0j, 0.0, 2)]
    assert double.count(re=(0, 1), im=(-1, 1), edge="inside") == 2


@pytest.mark.parametrize("name", CASES)
def test_all_roots_within_their_radii(name):
    case = CASES[name]
    found = make(case).roots(**region(case), edge="inside")
    assert found.counted == found.multiplicities.sum()
    held = np.zeros(len(found), dtype=int)
    with mp.workdps(30):
        for re, im, multiplicity in case["roots_25digits"]:
            root = mp.mpc(re, im)
            nearest = int(np.argmin(abs(found.roots - complex(root)) - found.radii))
            z, r = found[nearest], found.radii[nearest].item()
            assert abs(mp.mpc(z) - root) <= mp.mpf(r) + ULP * abs(z)
            # A disc about the real axis holds the mirror image as well.
            on_axis = abs(found[nearest].imag) <= found.radii[nearest] and root.imag != 0
            held[nearest] += multiplicity * (2 if on_axis else 1)
    assert held.tolist() == found.multiplicities.tolist()
    clusters = found.multiplicities[found.multiplicities > 1].tolist()
    multiple = [m for *_, m in case["roots"] if m > 1]
    assert clusters == multiple
    assert found.resolved.all()


@pytest.mark.parametrize("name", CASES)
def test_radii_are_not_larger_than_rounding_requires(name):
    """No larger, relative to the set, than 1000 times what one rounding must cost.

    The bounds add up some 60 roundings and take all of them for aligned.
    """
    case = CASES[name]
    found = make(case).roots(**region(case), edge="inside")
    errors = [e for e in case["double_precision_error_estimate"] if e is not None]
    if errors:
        size = max(1.0, float(np.abs(found.roots).max()))
        assert found.radii.max() <= 1000 * max(errors) * size


@pytest.mark.parametrize("name", sorted(set(CASES) - CHAINS_LEAD - REGION_ONLY))
def test_rightmost_is_the_certified_one(name):
    case = CASES[name]
    found = make(case).rightmost()
    wanted = complex(case["rightmost"]["re"], case["rightmost"]["im"])
    assert abs(found[0] - wanted) <= found.radii[0] + ULP * max(abs(wanted), 1)
    (line, end), im = found.region
    assert line < found[0].real < end == math.inf
    assert im == (-math.inf, math.inf)


@pytest.mark.parametrize("name", sorted(CHAINS_LEAD))
def test_right_of_the_chains_there_can_be_no_root(name):
    h = make(CASES[name])
    assert len(h.rightmost()) == 0
    assert h.spectral_abscissa() == h.chain_abscissa()


@pytest.mark.parametrize(
    "name", ["qpmr_ex1", "humphries_k3", "neutral_unstable_chain", "lambertw_yi"]
)
def test_several_rightmost_roots(name):
    case = CASES[name]
    for n in (2, 3, 5):
        found = make(case).rightmost(n)
        upper = [z for z in found if z.imag >= 0]
        wanted = [complex(re, im) for re, im, _ in case["roots"][:n]]
        assert np.allclose(upper, wanted, rtol=0, atol=1e-12)
        assert make(case).count(re=(found.region[0][0], None)) == found.counted
