"""Maps of families affine in neither parameter: against single cells, closed forms."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime import delay, s
from deadtime.stability import MapStatus
from hypothesis import given, settings, strategies as st
from map_families import assert_roots_on_the_axis

T1, T2, K, T, a = dtm.parameters("T1 T2 K T a")
SECOND = s**2 + 0.5 * s + 1.0

FAMILIES = {
    "two delays": (s + 1.2 * delay(T1) + 0.8 * delay(T2), {"T1": (0.01, 3), "T2": (0.0, 3)}),
    "square of a gain": (s + K * K * delay(T), {"K": (-1, 3), "T": (0.0, 2)}),
    "sum of delays": (
        SECOND + (0.6 * s + 0.4) * delay(T1) + 0.5 * delay(T2) + 0.2 * delay(T1 + T2),
        {"T1": (0, 6), "T2": (0, 6)},
    ),
    "neutral": (
        s + 0.4 * s * delay(T1) + 1.5 * delay(T2) + 0.5,
        {"T1": (0, 2), "T2": (0, 2)},
    ),
    "chains vary": (
        s + a * a * s * delay(T) + 1.5 * delay(T) + 0.5,
        {"a": (-1.2, 1.2), "T": (0.1, 2)},
    ),
    "delay and plant": (s * (a * a * s + 1) + 2.0 * a * delay(T), {"a": (0.1, 2), "T": (0.05, 2)}),
    "multiples of two delays": (
        s + 0.9 * delay(T1) + 0.3 * delay(2 * T1) + 0.7 * delay(T2) + 0.4 * delay(2 * T2),
        {"T1": (0, 4), "T2": (0.01, 4)},
    ),
    "proportional and velocity": (s + (K + 0.3 * s) * delay(T), {"K": (-1, 6), "T": (0.01, 2)}),
    "equal moduli at 0": (s + K * K + delay(T), {"K": (-2, 2), "T": (0, 3)}),
    "leading term vanishes": (
        a * a * s**2 + a * s + 1 + 0.5 * delay(T),
        {"a": (-1, 1), "T": (0, 2)},
    ),
}
names = pytest.mark.parametrize("name", FAMILIES)


def assert_same(family, ranges, shape, **options):
    """The map by curves has the counts and statuses of the one by cells."""
    options = {"abscissa": False, **options}
    curves = dtm.stability_map(family, ranges, shape, **options)
    cells = dtm.stability_map(family, ranges, shape, proof="cells", **options)
    np.testing.assert_array_equal(curves.unstable, cells.unstable)
    np.testing.assert_array_equal(curves.status, cells.status)
    if options["abscissa"]:
        np.testing.assert_allclose(curves.abscissa, cells.abscissa, rtol=1e-9, atol=1e-9)
    return curves


@names
@pytest.mark.parametrize("shape", [(75, 70), (2, 40), (40, 2), (2, 3)])
def test_every_cell_is_the_one_counted_alone(name, shape):
    assert_same(*FAMILIES[name], shape)


@names
@pytest.mark.parametrize("decay", [0.0, 0.2, -0.3])
def test_abscissas_followed_along_a_delay_are_those_of_single_cells(name, decay):
    assert_same(*FAMILIES[name], (11, 60), abscissa=True, decay=decay)


@names
@pytest.mark.parametrize(
    "options",
    [
        {"decay": 0.2},
        {"decay": -0.3},
        {"damping": (0.3, 0.8)},
        {"decay": 0.1, "damping": (0.5, 0.6)},
    ],
)
def test_every_cell_with_decay_and_damping_is_the_one_counted_alone(name, options):
    assert_same(*FAMILIES[name], (23, 22), **options)


def test_points_need_not_be_even_nor_in_order():
    family, _ = FAMILIES["two delays"]
    uneven = np.geomspace(0.01, 3.0, 40)
    chart = assert_same(family, {"T1": uneven, "T2": uneven}, (9, 9))
    assert set(np.unique(chart.unstable)) >= {0, 2}


def test_the_number_of_threads_makes_no_difference():
    family, ranges = FAMILIES["sum of delays"]
    one, two = (
        dtm.stability_map(family, ranges, (150, 140), abscissa=False, threads=n) for n in (1, 2)
    )
    np.testing.assert_array_equal(one.unstable, two.unstable)
    np.testing.assert_array_equal(one.status, two.status)


def test_a_root_that_stays_at_0_is_on_the_boundary_everywhere():
    family = s**2 + s * delay(T1) + 0.5 * s * delay(T2)
    chart = assert_same(family, {"T1": (0, 2), "T2": (0, 2)}, (9, 8))
    assert (chart.status == MapStatus.BOUNDARY).all()
    with pytest.raises(ValueError, match="have a root at 0"):
        _ = chart.boundaries


def test_chains_make_infinitely_many():
    family, ranges = FAMILIES["chains vary"]
    chart = assert_same(family, ranges, (61, 20))
    modulus = np.abs(chart.axes["a"])
    assert (chart.unstable[modulus > 1.0 + 1e-12] == -1).all()
    assert (chart.unstable[modulus < 1.0 - 1e-12] >= 0).all()


terms = st.tuples(
    st.floats(-2, 2), st.integers(0, 1), st.sampled_from(["T1", "T2", "both", "none"])
)


@settings(max_examples=40, deadline=None)
@given(st.lists(terms, min_size=1, max_size=4), st.floats(-0.4, 0.4), st.floats(-0.7, 0.7))
def test_random_families(rows, decay, neutral):
    delays = {"T1": delay(T1), "T2": delay(T2), "both": delay(0.5 * T1 + T2), "none": 1}
    family = s**2 + neutral * s**2 * delay(T2)
    # Two delays that move, so that no parameter is a mere factor.
    family = family + 0.5 * delay(T1) + 0.3 * s * delay(T2)
    for coefficient, power, name in rows:
        family = family + coefficient * s**power * delays[name]
    assert_same(family, {"T1": (0.0, 1.5), "T2": (0.1, 1.5)}, (17, 16), decay=decay)


def test_the_boundary_of_a_square_is_the_closed_form():
    # s = j w: w = K^2, w T = pi/2 + 2 pi n.
    family, _ = FAMILIES["square of a gain"]
    chart = dtm.stability_map(family, {"K": (0.5, 3.0), "T": (0.1, 2.0)}, (60, 90), abscissa=False)
    assert chart.boundaries
    for curve in chart.boundaries:
        np.testing.assert_allclose(curve.omega, curve.values["K"] ** 2, rtol=1e-9)
        turns = (curve.omega * curve.values["T"] - np.pi / 2) / (2 * np.pi)
        np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
        assert (curve.crossing == 2).all()
    longest = chart.boundaries[0]
    assert longest.along == "T"
    assert len(longest) > 40


@names
def test_boundaries_are_roots_on_the_axis(name):
    family, ranges = FAMILIES[name]
    chart = dtm.stability_map(family, ranges, (41, 40), abscissa=False)
    # Where the leading term vanishes, roots go through infinity.
    assert bool(chart.boundaries) == (name != "leading term vanishes")
    # Newton's last step is below 1e-10, and what it leaves is of the order of its square.
    assert_roots_on_the_axis(family, chart.boundaries, 5, 1e-11)


@pytest.mark.parametrize("options", [{}, {"decay": 0.2}, {"damping": (0.2, 0.5)}])
def test_counts_along_a_row_differ_by_what_crosses(options):
    family, ranges = FAMILIES["sum of delays"]
    chart = assert_same(family, ranges, (30, 31), **options)
    (across,) = (name for name in chart.names if name != chart.boundaries[0].along)
    counts = chart.unstable if across == chart.names[0] else chart.unstable.T
    points = chart.axes[chart.boundaries[0].along]
    for index, at in enumerate(chart.axes[across]):
        # Every step of the count along the row is a sum of crossings there.
        jumps = np.zeros(len(points) - 1, int)
        for curve in chart.boundaries:
            met = curve.values[across] == at
            places = np.searchsorted(points, curve.values[curve.along][met]) - 1
            np.add.at(jumps, places, curve.crossing[met])
        np.testing.assert_array_equal(np.diff(counts[index]), jumps)
