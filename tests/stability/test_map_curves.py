"""Maps by crossing curves: against counts of single cells, closed forms, and each other."""

import math
import pickle

import deadtime as dtm
import numpy as np
import pytest
from deadtime import delay, s
from deadtime.stability import MapStatus
from hypothesis import assume, given, strategies as st
from map_families import FAMILIES, LAG, OMEGA, ZETA, assert_roots_on_the_axis

names = pytest.mark.parametrize("name", FAMILIES)


def both(family, ranges, shape, **options):
    """The map by curves and the one by cells."""
    return (
        dtm.stability_map(family, ranges, shape, abscissa=False, proof=proof, **options)
        for proof in ("curves", "cells")
    )


def assert_same(curves, cells):
    np.testing.assert_array_equal(curves.unstable, cells.unstable)
    np.testing.assert_array_equal(curves.status, cells.status)


@names
@pytest.mark.parametrize("shape", [(61, 60), (2, 2), (2, 90), (90, 2)])
def test_every_cell_is_the_one_counted_alone(name, shape):
    family, ranges = FAMILIES[name]
    assert_same(*both(family, ranges, shape))


@names
@pytest.mark.parametrize("options", [{"decay": 0.3}, {"decay": -0.4}, {"damping": (0.5, 3.0)}])
def test_every_cell_with_decay_and_damping_is_the_one_counted_alone(name, options):
    family, ranges = FAMILIES[name]
    assert_same(*both(family, ranges, (31, 30), **options))


@names
def test_abscissas_are_those_of_cells_alone(name):
    family, ranges = FAMILIES[name]
    chart = dtm.stability_map(family, ranges, (40, 41))
    cells = dtm.stability_map(family, ranges, (40, 41), proof="cells")
    assert_same(chart, cells)
    # Discs are at most 1e-11 wide, of the root or of one over the delay.
    np.testing.assert_allclose(chart.abscissa, cells.abscissa, rtol=1e-10, atol=1e-10)


def test_a_slanted_edge_is_searched_to_its_end():
    # It was once left at the height at which the last, upright piece ends.
    a, b = dtm.parameters("a b")
    family = s**3 + 2 * b * delay(0.25) + 0 * a
    ranges = {"a": [0.0], "b": np.array([-2.0, -1.0, 1.0])}
    chart = dtm.stability_map(family, ranges, abscissa=False, damping=(0.4, 1.5))
    assert chart.unstable.tolist() == [[3, 1, 2]]


def test_the_damping_ratio_is_that_of_the_roots():
    family, ranges = FAMILIES["pendulum"]
    ratio, horizon, decay = 0.45, 2.5, 0.2
    chart = dtm.stability_map(
        family, ranges, (9, 8), abscissa=False, decay=decay, damping=(ratio, horizon)
    )
    for (i, j), unstable in np.ndenumerate(chart.unstable):
        h = family.at(
            **{name: chart.axes[name][k] for name, k in zip(chart.names, (i, j), strict=True)}
        )
        found = h.roots(re=(-horizon, None))
        weak = -found.roots.real < ratio * np.abs(found.roots)
        assert unstable == found.multiplicities[weak | (found.roots.real > -decay)].sum()


def test_the_boundary_of_the_velocity_loop_is_the_closed_form():
    family, ranges = FAMILIES["velocity"]
    chart = dtm.stability_map(family, ranges, (50, 201), abscissa=False)
    pairs = [curve for curve in chart.boundaries if curve.omega.min() > 0]
    assert pairs
    for curve in pairs:
        # s = j w: Kp = w sin(w T), Kv = -cos(w T).
        np.testing.assert_allclose(
            curve.values["Kp"], curve.omega * np.sin(curve.omega * LAG), atol=1e-9
        )
        np.testing.assert_allclose(curve.values["Kv"], -np.cos(curve.omega * LAG), atol=1e-9)
        assert (np.abs(curve.crossing) == 2).all()
    (real,) = (curve for curve in chart.boundaries if curve.omega.max() == 0)
    np.testing.assert_allclose(real.values["Kp"], 0, atol=1e-12)
    assert (real.crossing == -1).all()


@names
def test_boundaries_are_roots_on_the_axis(name):
    family, ranges = FAMILIES[name]
    chart = dtm.stability_map(family, ranges, (80, 79), abscissa=False)
    assert chart.boundaries
    assert_roots_on_the_axis(family, chart.boundaries, 7, 1e-12)


@pytest.mark.parametrize("decay", [0.0, 0.4])
def test_boundaries_separate_different_counts(decay):
    family, ranges = FAMILIES["two delays"]
    chart = dtm.stability_map(family, ranges, (60, 60), abscissa=False, decay=decay)
    step = 1e-4
    for curve in chart.boundaries:
        other = next(name for name in chart.names if name != curve.along)
        for index in range(1, len(curve) - 1, 11):
            at = {key: float(value[index]) for key, value in curve.values.items()}
            sides = [
                family.at(**{curve.along: at[curve.along] + side * step, other: at[other]}).count(
                    re=(-decay, None)
                )
                for side in (-1, 1)
            ]
            assert sides[1] - sides[0] == curve.crossing[index]


def test_cells_on_the_boundary_have_their_own_status():
    family, ranges = FAMILIES["velocity"]
    chart = dtm.stability_map(family, ranges, (21, 21), abscissa=False)
    on_it = chart.status == MapStatus.BOUNDARY
    expected = np.zeros_like(on_it)
    expected[0, :] = expected[:, 0] = expected[:, -1] = True
    np.testing.assert_array_equal(on_it, expected)
    gain = math.pi / (2 * LAG)
    alone = dtm.stability_map(
        s + dtm.parameters("Kp")[0] * delay(LAG) + 0 * dtm.parameters("q")[0],
        {"Kp": [1.0, math.nextafter(gain, 0), gain, 5.0], "q": [0.0]},
        abscissa=False,
    )
    # pi/2 is rounded: the roots lie 1e-16 beside the axis, told by two words or left open.
    assert alone.unstable[0, 0] == 0
    assert alone.unstable[3, 0] == 2
    assert set(alone.unstable[1:3, 0]) <= {0, 2, -2}


def test_the_limits_of_the_altitude_loop():
    # Kp = pi/(2 Td), |Kv| = 1; with the hold of 0.065 s: 4.024 at 0.36 s and 12.46 at 0.10 s.
    family, _ = FAMILIES["velocity"]
    edge = math.pi / (2 * LAG)
    chart = dtm.stability_map(
        family,
        {"Kp": np.array([edge - 1e-9, edge + 1e-9]), "Kv": np.array([-1.1, 0.0, 1.1])},
        abscissa=False,
    )
    assert chart.unstable.tolist() == [[-1, 0, -1], [-1, 2, -1]]
    for time, limit in ((0.36, 4.0244), (0.10, 12.459)):
        loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1.0), delay=time, sample_time=0.065)
        sampled = dtm.stability_map(
            loop, {"Kp": np.array([limit - 1e-3, limit + 1e-3]), "gain": [1.0]}, abscissa=False
        )
        assert sampled.unstable.ravel().tolist() == [0, 2]


def test_the_filtered_loop_is_that_of_the_control_loop():
    family, ranges = FAMILIES["filtered velocity"]
    controller = dtm.PV(Kp=1.0, Kv=0.1, filter=dtm.DerivativeFilter(OMEGA, ZETA))
    loop = dtm.ControlLoop(dtm.Integrator(), controller, delay=LAG)
    direct = dtm.stability_map(family, ranges, (24, 25), abscissa=False)
    by_loop = dtm.stability_map(loop, ranges, (24, 25), abscissa=False)
    np.testing.assert_array_equal(direct.unstable, by_loop.unstable)


gains = st.floats(-5, 5).map(lambda x: round(x, 3))
times = st.floats(0.05, 2).map(lambda x: round(x, 3))


@st.composite
def families(draw):
    """Affine in a, often also in b, of degree one to three, with up to four delays."""
    a, b = dtm.parameters("a b")
    degree = draw(st.integers(1, 3))
    h = s**degree
    for power in range(degree):
        h = h + draw(gains) * s**power
    h = h + a * sum((draw(gains) * s**k for k in range(degree)), 0 * s) * delay(draw(times))
    h = h + b * (draw(gains) + draw(gains) * s ** (degree - 1)) * delay(draw(times))
    if draw(st.booleans()):
        h = h + a * b * draw(gains) * delay(draw(times))
    if draw(st.booleans()):
        h = h + draw(st.floats(-0.9, 0.9)) * s**degree * delay(draw(times))
    return h


@given(family=families(), low=gains, high=gains)
def test_random_families_are_counted_alike(family, low, high):
    assume(low < high)
    assume(set(family.names) == {"a", "b"})
    assert_same(*both(family, {"a": (low, high), "b": (-2.0, 3.0)}, (9, 5)))


@given(family=families(), low=gains, high=gains, decay=st.floats(0.05, 0.5))
def test_random_families_have_the_same_abscissas(family, low, high, decay):
    assume(low < high)
    assume(set(family.names) == {"a", "b"})
    ranges = {"a": (low, high), "b": (-2.0, 3.0)}
    chart = dtm.stability_map(family, ranges, (9, 3), decay=decay)
    cells = dtm.stability_map(family, ranges, (9, 3), decay=decay, proof="cells")
    np.testing.assert_array_equal(chart.unstable, cells.unstable)
    known = np.isfinite(chart.abscissa) & np.isfinite(cells.abscissa)
    # Next to a double root both are known to half the digits.
    np.testing.assert_allclose(chart.abscissa[known], cells.abscissa[known], rtol=1e-6, atol=1e-6)
    assert (np.isfinite(chart.abscissa) == np.isfinite(cells.abscissa)).all()


def test_a_mirror_image_is_not_a_second_root():
    # A followed root once went over to the lower half plane, onto the image of another one, and
    # the two of them made up for a pair that nobody followed.
    a, b = dtm.parameters("a b")
    family = 1 + 5 * s**2 + s**3 + 3 * b * s**2 * delay(0.875)
    family = family + (5 * a * s**2 - 2 * a * s) * delay(1.938)
    chart = dtm.stability_map(family, {"a": (-0.688, 4.75), "b": [3.0]}, (13, 1 + 1))
    worst = [family.at(a=float(k), b=3.0).spectral_abscissa() for k in chart.axes["a"]]
    np.testing.assert_allclose(chart.abscissa[:, 0], worst, atol=1e-10)


def test_pickled_maps_keep_their_boundaries():
    family, ranges = FAMILIES["two delays"]
    chart = dtm.stability_map(family, ranges, (20, 20), abscissa=False)
    again = pickle.loads(pickle.dumps(chart))
    assert len(again.boundaries) == len(chart.boundaries)
    np.testing.assert_array_equal(again.boundaries[0].omega, chart.boundaries[0].omega)
    with pytest.raises(ValueError, match="read-only"):
        again.boundaries[0].omega[0] = 1.0


@pytest.mark.parametrize(
    ("options", "error", "word"),
    [
        ({"proof": "trust"}, ValueError, "curves"),
        ({"decay": math.nan}, ValueError, "decay"),
        ({"damping": 0.5}, TypeError, "ratio"),
        ({"damping": (1.5, 3.0)}, ValueError, "between 0 and 1"),
        ({"damping": (0.5, -1.0)}, ValueError, "horizon"),
        ({"damping": (0.5, 1.0), "decay": 2.0}, ValueError, "above the decay"),
    ],
)
def test_invalid_requirements_are_refused(options, error, word):
    family, ranges = FAMILIES["velocity"]
    with pytest.raises(error, match=word):
        dtm.stability_map(family, ranges, (3, 3), **options)


def test_decay_of_sampled_loops_is_that_of_their_abscissa():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.0, 0.1), delay=LAG, sample_time=0.065)
    chart = dtm.stability_map(loop, {"Kp": (0.1, 4), "Kv": (0, 0.5)}, (14, 13), decay=0.5)
    np.testing.assert_array_equal(chart.stable, chart.abscissa < -0.5)
    assert 0 < chart.stable.sum() < chart.stable.size
    plain = dtm.stability_map(loop, {"Kp": (0.1, 4), "Kv": (0, 0.5)}, (14, 13))
    np.testing.assert_array_equal(chart.abscissa, plain.abscissa)
    assert (chart.unstable >= plain.unstable).all()


@pytest.mark.parametrize(
    "family",
    [
        pytest.param(lambda a, b: s + a * delay(0.3) + 0 * b, id="not b"),
        pytest.param(lambda a, b: a * s + b, id="leading term varies"),
        pytest.param(
            lambda a, b: s + a * s * delay(0.3) + b * s * delay(0.5) + 1, id="chains vary"
        ),
        pytest.param(lambda a, b: s + a + b * s**2 * delay(0.4), id="advanced"),
        pytest.param(lambda a, b: a * (s + 1) + b * (s + 1) * delay(0.4), id="common factor"),
        pytest.param(lambda a, b: s**2 + a + b + 1, id="roots stay on the axis"),
        pytest.param(lambda a, b: a + b * delay(0.4), id="no derivative"),
        pytest.param(
            lambda a, b: s**3 * delay(0.2) + a * delay(0.3) + b * s * delay(0.9), id="late"
        ),
    ],
)
def test_degenerate_families_are_judged_like_their_cells(family):
    a, b = dtm.parameters("a b")
    h = family(a, b) + 0 * a + 0 * b
    assume_names = set(h.names)
    assert assume_names == {"a", "b"}
    assert_same(*both(h, {"a": (-2, 2), "b": (-1, 3)}, (9, 9)))


@names
@pytest.mark.parametrize("show", ["counts", "abscissa"])
def test_pictures_show_the_boundaries(name, show):
    plt = pytest.importorskip("matplotlib.pyplot")
    family, ranges = FAMILIES[name]
    chart = dtm.stability_map(family, ranges, (30, 30))
    _, ax = plt.subplots()
    chart.plot(ax, show=show)
    drawn = sum(len(line.get_xdata()) for line in ax.lines)
    assert drawn == sum(map(len, chart.boundaries))
    assert any("ω" in text.get_text() for text in ax.texts)
    plt.close("all")
