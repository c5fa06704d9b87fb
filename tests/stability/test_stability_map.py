"""Maps of stability, against closed forms and pointwise calls."""

import math
import os
import pickle
import signal
import sys
import threading

import deadtime as dtm
import numpy as np
import pytest
from deadtime import delay, s
from deadtime.stability import MapStatus
from scipy.special import lambertw

Kp, Kv, Td = dtm.parameters("Kp Kv Td")
INTEGRATOR = s + Kp * delay(Td)
T = 0.36
VELOCITY = s + (Kp + Kv * s) * delay(T)


def pairs(product, first):
    """Crossings at first + 2 pi k that `product` lies beyond."""
    return np.maximum(np.ceil((product - first) / (2 * np.pi)), 0).astype(int)


def integrator_by_hand(gain, time):
    """Unstable roots of s + K exp(-s T).

    s = jw: w = K and w T = pi/2 + 2 pi k for K > 0, so pairs cross at K T = pi/2 + 2 pi k, to the
    right. For K < 0 there is one real root on the right, and pairs cross at
    |K| T = 3 pi/2 + 2 pi k.
    """
    size = np.abs(gain) * time
    return np.where(gain > 0, 2 * pairs(size, np.pi / 2), 1 + 2 * pairs(size, 1.5 * np.pi))


def velocity_by_hand(kp, kv):
    """Unstable roots of s + (Kp + Kv s) exp(-s T), |Kv| < 1, by D-subdivision.

    s = jw, w > 0, after multiplying by exp(jwT):  Kp = w sin(wT),  Kv = -cos(wT).  Hence with
    theta = arccos(-Kv), wT = theta + 2 pi k and Kp = w sin(theta) > 0, or wT = 2 pi k - theta,
    k >= 1, and Kp = -w sin(theta) < 0. w = 0 gives Kp = 0, where one real root crosses as
    s = -Kp/(1 + Kv). Away from Kp = 0 roots only move to the right as |Kp| grows.
    """
    theta = np.arccos(-kv)
    size = np.abs(kp) * T / np.sin(theta)
    return np.where(kp > 0, 2 * pairs(size, theta), 1 + 2 * pairs(size, 2 * np.pi - theta))


def test_integrator_map_is_that_of_the_closed_form_in_every_cell():
    chart = dtm.stability_map(
        INTEGRATOR, {"Kp": (-40, 40), "Td": (0.0, 2.0)}, shape=(120, 81), abscissa=False
    )
    gain, time = np.meshgrid(*chart.axes.values(), indexing="ij")
    np.testing.assert_array_equal(chart.unstable, integrator_by_hand(gain, time))
    np.testing.assert_array_equal(chart.stable, (gain > 0) & (gain * time < np.pi / 2))
    assert (chart.status == MapStatus.OK).all()
    assert np.isnan(chart.abscissa).all()


def test_abscissa_is_that_of_lambert_w():
    chart = dtm.stability_map(INTEGRATOR, {"Kp": (-3, 9), "Td": (0.05, 1.0)}, shape=(60, 20))
    gain, time = np.meshgrid(*chart.axes.values(), indexing="ij")
    truth = lambertw(-gain * time).real / time
    # W has the condition 1/|1 + W|: next to the double root it is known to half the digits.
    distance = np.abs(1 + lambertw(-gain * time))
    assert (np.abs(chart.abscissa - truth) <= 1e-13 / time / np.minimum(distance, 1)).all()


@pytest.mark.parametrize("kv", [(-0.995, 0.995), (-0.5, -0.4)])
def test_velocity_map_is_that_of_d_subdivision_in_every_cell(kv):
    chart = dtm.stability_map(
        VELOCITY, {"Kp": (-25, 60), "Kv": kv}, shape=(150, 61), abscissa=False
    )
    by_hand = velocity_by_hand(*np.meshgrid(*chart.axes.values(), indexing="ij"))
    np.testing.assert_array_equal(chart.unstable, by_hand)


def test_velocity_map_beyond_the_chains():
    chart = dtm.stability_map(
        VELOCITY, {"Kv": [-1.3, -1.0001, -1.0, -0.9, 0.9, 1.0, 1.0001, 1.3], "Kp": (0.5, 2.0)}
    )
    assert chart.names == ("Kv", "Kp")
    assert chart.unstable.shape == (8, 101)
    endless, on_axis = chart.unstable[[0, 1, 6, 7]], chart.unstable[[2, 5]]
    assert (endless == -1).all()
    assert (chart.status[[0, 1, 6, 7]] == MapStatus.INFINITE).all()
    assert (chart.abscissa[[0, 1, 6, 7]] > 0).all()
    # |Kv| = 1: the chain runs along the imaginary axis.
    assert (on_axis == -2).all()
    assert (chart.status[[2, 5]] == MapStatus.BOUNDARY).all()
    assert not chart.stable[[0, 1, 2, 5, 6, 7]].any()
    assert chart.stable[[3, 4]].any()


def test_root_at_zero_is_on_the_boundary():
    chart = dtm.stability_map(
        VELOCITY, {"Kp": np.array([0.0, 1.0]), "Kv": (-0.9, 0.9)}, shape=(2, 21)
    )
    assert (chart.status[0] == MapStatus.BOUNDARY).all()
    assert (chart.unstable[0] == -2).all()
    assert (np.abs(chart.abscissa[0]) < 1e-300).all()
    assert not chart.stable[0].any()
    assert chart.stable[1].any()


def test_chains_lead_where_no_root_lies_right_of_them():
    # A difference equation: its roots are its chain.
    (a, b) = dtm.parameters("a b")
    chart = dtm.stability_map(
        a + b * delay(0.5), {"a": np.array([1.0, 2.0]), "b": np.array([0.5, 1.5])}
    )
    expected = [[MapStatus.CHAIN, MapStatus.INFINITE], [MapStatus.CHAIN, MapStatus.CHAIN]]
    np.testing.assert_array_equal(chart.status, expected)
    by_hand = np.log([[0.5, 1.5], [0.25, 0.75]]) / 0.5
    np.testing.assert_allclose(chart.abscissa, by_hand, rtol=1e-14)
    np.testing.assert_array_equal(chart.stable, by_hand < 0)


def test_kind_may_change_from_cell_to_cell():
    (a, b) = dtm.parameters("a b")
    chart = dtm.stability_map(
        a * s + 1 + b * s * delay(0.5), {"a": np.array([0.0, 1.0]), "b": np.array([0.0, 0.5])}
    )
    # A constant has no root; 1 + s exp(-s/2)/2 is advanced; s + 1; neutral.
    assert chart.status.tolist() == [
        [MapStatus.OK, MapStatus.INFINITE],
        [MapStatus.OK, MapStatus.OK],
    ]
    assert chart.unstable.tolist() == [[0, -1], [0, 0]]
    assert chart.abscissa[0].tolist() == [-math.inf, math.inf]
    assert chart.abscissa[1, 0] == pytest.approx(-1, rel=1e-14)


def test_zero_function_and_overflow_are_undecided():
    (a, b) = dtm.parameters("a b")
    chart = dtm.stability_map(
        a**2 * s + b, {"a": np.array([0.0, 1e200]), "b": np.array([0.0, 1.0])}
    )
    assert chart.status.tolist() == [
        [MapStatus.UNDECIDED, MapStatus.OK],
        [MapStatus.UNDECIDED, MapStatus.UNDECIDED],
    ]
    assert chart.unstable.tolist() == [[-2, 0], [-2, -2]]


@pytest.mark.parametrize("family", [VELOCITY, INTEGRATOR * (1 + 0.25 * s), VELOCITY + 0.02 * s**2])
def test_cell_is_the_pointwise_call(family):
    ranges = dict.fromkeys(family.names, (0.07, 0.93))
    chart = dtm.stability_map(family, ranges, shape=(7, 6))
    for (i, j), unstable in np.ndenumerate(chart.unstable):
        cell = zip(chart.names, (i, j), strict=True)
        h = family.at(**{name: chart.axes[name][k] for name, k in cell})
        assert unstable == h.count(re=(0, None))
        # Two ways to the same root, each within its disc.
        assert abs(chart.abscissa[i, j] - h.spectral_abscissa()) <= 1e-11
        assert chart.stable[i, j] == h.is_stable()


def test_bits_are_the_same_for_any_number_of_threads():
    ranges = {"Kp": (-1, 8), "Kv": (-1.2, 1.2)}
    one, two = (dtm.stability_map(VELOCITY, ranges, (40, 31), threads=n) for n in (1, 2))
    assert one.unstable.tobytes() == two.unstable.tobytes()
    assert one.abscissa.tobytes() == two.abscissa.tobytes()
    assert one.status.tobytes() == two.status.tobytes()


# Loops


def test_continuous_loop_is_its_characteristic_function():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(Kp=1, Kv=0.1), delay=T, limit=1.0)
    ranges = {"Kp": (0.1, 6), "Kv": (-0.9, 0.9)}
    chart = dtm.stability_map(loop, ranges, (12, 9))
    expected = dtm.stability_map(VELOCITY, ranges, (12, 9))
    np.testing.assert_array_equal(chart.unstable, expected.unstable)
    np.testing.assert_array_equal(chart.abscissa, expected.abscissa)


def test_continuous_loop_over_plant_and_delay():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PI(Kp=1, Ki=0.1))
    chart = dtm.stability_map(
        loop, {"delay": np.array([0.0, 0.2, 0.4]), "lag": np.array([0.0, 0.3])}, abscissa=False
    )
    for (i, j), unstable in np.ndenumerate(chart.unstable):
        time, lag = chart.axes["delay"][i], chart.axes["lag"][j]
        h = loop.replace(delay=time, lag=lag).characteristic()
        assert unstable == h.count(re=(0, None))


@pytest.mark.parametrize(
    ("time", "sample_time", "limit"),
    [(0.36, 0.065, 4.024), (0.10, 0.065, 12.46), (0.36, None, 4.363)],
)
def test_hold_lowers_the_largest_gain(time, sample_time, limit):
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1), delay=time, sample_time=sample_time)
    gains = limit * np.array([0.5, 0.9, 0.9998, 1.0005, 1.1])
    chart = dtm.stability_map(loop, {"Kp": gains, "delay": np.array([time, 1.5 * time])})
    assert chart.stable[:, 0].tolist() == [True, True, True, False, False]
    assert chart.unstable[:, 0].tolist() == [0, 0, 0, 2, 2]
    assert not chart.stable[2:, 1].any()


SAMPLED = [
    (dtm.Integrator(), dtm.P(Kp=1), {"Kp": (0.5, 5), "delay": (0.0, 0.5)}),
    (dtm.Integrator(gain=0.9), dtm.PV(Kp=1, Kv=0.1), {"Kp": (0.5, 5), "Kv": (-0.9, 0.9)}),
    (dtm.Integrator(lag=0.2), dtm.PID(Kp=1, Ki=0.2, Kd=0.1), {"gain": (0.5, 5), "Ki": (-1, 1.5)}),
    (dtm.Integrator(lag=0.2), dtm.PI(Kp=1, Ki=0.2), {"lag": (0.1, 0.5), "Kp": (0.5, 2)}),
    (
        dtm.FirstOrder(),
        dtm.PV(Kp=1, Kv=0.1, filter=dtm.DerivativeFilter(20)),
        {"omega": (5, 20), "time_constant": (0.2, 1)},
    ),
    (dtm.FirstOrder(), dtm.P(Kp=1), {"sample_time": (0.01, 0.1), "delay": (0.0, 0.2)}),
    (dtm.FirstOrder(), dtm.P(Kp=1), {"time_constant": (0.2, 1), "sample_time": (0.01, 0.1)}),
]


@pytest.mark.parametrize(("plant", "controller", "ranges"), SAMPLED)
def test_sampled_cell_is_the_pointwise_call(plant, controller, ranges):
    loop = dtm.ControlLoop(plant, controller, delay=T, sample_time=0.065, limit=2.0)
    chart = dtm.stability_map(loop, ranges, shape=(4, 3))
    for (i, j), abscissa in np.ndenumerate(chart.abscissa):
        cell = zip(chart.names, (i, j), strict=True)
        here = loop.replace(**{name: chart.axes[name][k] for name, k in cell})
        matrix = here.transition_matrix()
        rho = np.abs(np.linalg.eigvals(matrix))
        # Eigenvalues by two routes: the transition matrices are not far from defective ones.
        assert abscissa == pytest.approx(math.log(rho.max()) / here.sample_time, abs=1e-7)
        assert chart.unstable[i, j] == (rho > 1).sum()
        assert chart.stable[i, j] == here.is_stable()


def test_sampled_loop_with_a_pole_on_the_circle():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1), delay=0.1, sample_time=0.1)
    chart = dtm.stability_map(loop, {"Kp": np.array([0.0, 1.0]), "gain": np.array([1.0, 2.0])})
    assert (chart.status[0] == MapStatus.BOUNDARY).all()
    assert (chart.unstable[0] == -2).all()
    assert chart.stable[1].all()


def test_loop_without_a_delay_needs_a_range_for_it():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(Kp=1, Kv=0.1))
    with pytest.raises(ValueError, match="delay of this loop is None"):
        dtm.stability_map(loop, {"Kp": (0, 1), "Kv": (0, 1)})
    dtm.stability_map(loop, {"Kp": (0, 1), "delay": (0, 1)}, shape=(2, 2))
    with pytest.raises(ValueError, match=r"limit.*does not depend on.*delay"):
        dtm.stability_map(loop.replace(limit=1.0), {"Kp": (0, 1), "limit": (1, 2)})
    with pytest.raises(ValueError, match="sample_time"):
        dtm.stability_map(loop.replace(delay=0.1), {"Kp": (0, 1), "sample_time": (0.1, 0.2)})


@pytest.mark.parametrize("name", ["delay", "sample_time"])
def test_times_of_a_sampled_loop_are_not_negative(name):
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1), delay=0.1, sample_time=0.1)
    with pytest.raises(ValueError, match=f"{name}=-0.1"):
        dtm.stability_map(loop, {"Kp": (0, 1), name: (-0.1, 0.1)})


# The map as an object


def test_best_is_the_leftmost_abscissa():
    chart = dtm.stability_map(VELOCITY, {"Kp": (0.1, 6), "Kv": (-0.95, 0.95)}, shape=(50, 39))
    values, abscissa = chart.best()
    assert abscissa == chart.abscissa[chart.stable].min()
    assert abs(VELOCITY.at(**values).spectral_abscissa() - abscissa) <= 1e-11
    with pytest.raises(ValueError, match="no cell of the map is stable"):
        dtm.stability_map(VELOCITY, {"Kp": (-2, -1), "Kv": (0, 0.5)}, (3, 3)).best()
    with pytest.raises(ValueError, match="abscissa=True"):
        dtm.stability_map(VELOCITY, {"Kp": (1, 2), "Kv": (0, 0.5)}, (3, 3), abscissa=False).best()


def test_arrays_are_read_only_and_survive_pickling():
    chart = dtm.stability_map(
        VELOCITY, {"Kp": (0.1, 6), "Kv": np.array([0.0, 0.1, 0.3])}, shape=(5, 9)
    )
    assert chart.names == ("Kp", "Kv")
    np.testing.assert_array_equal(chart.axes["Kp"], np.linspace(0.1, 6, 5))
    np.testing.assert_array_equal(chart.axes["Kv"], [0.0, 0.1, 0.3])
    dtypes = {"unstable": np.int32, "abscissa": np.float64, "status": np.uint8, "stable": np.bool_}
    for name, dtype in dtypes.items():
        array = getattr(chart, name)
        assert array.shape == (5, 3)
        assert array.dtype == dtype
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 0
    with pytest.raises(ValueError, match="read-only"):
        chart.axes["Kp"][0] = 0
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(chart)).abscissa, chart.abscissa)
    assert repr(chart).startswith("<StabilityMap Kp 0.1 to 6 (5), Kv 0 to 0.3 (3):")


def test_given_points_are_not_shared():
    points = np.array([0.1, 0.2])
    chart = dtm.stability_map(VELOCITY, {"Kp": points, "Kv": (0, 0.5)}, shape=(2, 2))
    points[0] = 7.0
    assert chart.axes["Kp"][0] == 0.1


def test_plot_returns_its_axes():
    pytest.importorskip("deadtime._base.drawing")
    figure = pytest.importorskip("matplotlib.figure")
    ax = figure.Figure().subplots()
    chart = dtm.stability_map(VELOCITY, {"Kp": (0.1, 6), "Kv": (-0.9, 0.9)}, shape=(9, 8))
    assert chart.plot(ax, chosen={"Kp": 2.0, "Kv": 0.3}) is ax
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Kp", "Kv")


def test_to_xarray_without_xarray_says_what_to_install(monkeypatch):
    chart = dtm.stability_map(VELOCITY, {"Kp": (0.1, 6), "Kv": (-0.9, 0.9)}, shape=(3, 2))
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match="pip install xarray"):
        chart.to_xarray()


def test_to_xarray_names_the_axes():
    pytest.importorskip("xarray")
    chart = dtm.stability_map(VELOCITY, {"Kp": (0.1, 6), "Kv": (-0.9, 0.9)}, shape=(3, 2))
    data = chart.to_xarray()
    assert data["abscissa"].dims == ("Kp", "Kv")
    np.testing.assert_array_equal(data["unstable"].values, chart.unstable)
    np.testing.assert_array_equal(data["Kv"].values, chart.axes["Kv"])


# Long maps


def test_progress_is_reported_and_ends_with_all_cells():
    told = []
    ranges = {"Kp": (0.1, 6), "Kv": (-0.9, 0.9)}
    dtm.stability_map(VELOCITY, ranges, shape=(300, 200), proof="cells", progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 60000
    assert len(told) > 1


def test_failing_progress_stops_the_map():
    def fail(done):
        raise RuntimeError("enough")

    ranges = {"Kp": (0.1, 6), "Kv": (-0.9, 0.9)}
    with pytest.raises(RuntimeError, match="enough"):
        dtm.stability_map(VELOCITY, ranges, shape=(3000, 3000), progress=fail)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of another kind")
@pytest.mark.usefixtures("listens_to_ctrl_c")
def test_ctrl_c_stops_a_big_map():
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        dtm.stability_map(VELOCITY, {"Kp": (0.1, 6), "Kv": (-0.9, 0.9)}, shape=(3000, 3000))
    timer.join()


# Arguments

GOOD = {"Kp": (0.0, 6.0), "Kv": (-1.0, 1.0)}


@pytest.mark.parametrize(
    ("ranges", "match"),
    [
        ({"Kp": (0, 1)}, "a map has two"),
        ({"Kp": (0, 1), "Kv": (0, 1), "T": (0, 1)}, "a map has two"),
        ({"Kp": (0, 1), "Kd": (0, 1)}, r"Kd is not a parameter.*Kp, Kv"),
        ({"Kp": (1, 1), "Kv": (0, 1)}, "low end"),
        ({"Kp": (1, 0), "Kv": (0, 1)}, "low end"),
        ({"Kp": (0, np.inf), "Kv": (0, 1)}, "finite"),
        ({"Kp": (0, np.nan), "Kv": (0, 1)}, "finite"),
        ({"Kp": (0, 1, 1), "Kv": (0, 1)}, "n=2 or more"),
        ({"Kp": [], "Kv": (0, 1)}, "at least one point"),
        ({"Kp": [[0.0, 1.0]], "Kv": (0, 1)}, "one-dimensional"),
        ({"Kp": np.array([0.0, np.nan]), "Kv": (0, 1)}, "finite"),
        ({"Kp": np.array([0.0, 0.0]), "Kv": (0, 1)}, "increase"),
        ({"Kp": np.arange(10_000), "Kv": np.arange(10_000)}, "smaller"),
    ],
)
def test_bad_ranges_are_refused(ranges, match):
    with pytest.raises(ValueError, match=match):
        dtm.stability_map(VELOCITY, ranges)


@pytest.mark.parametrize(
    ("shape", "error"),
    [((1, 5), ValueError), ((10_000, 10_000), ValueError), (5, TypeError), ((5, 5.0), TypeError)],
)
def test_bad_shapes_are_refused(shape, error):
    with pytest.raises(error, match="shape"):
        dtm.stability_map(VELOCITY, GOOD, shape)


def test_bad_families_are_refused():
    with pytest.raises(TypeError, match="QuasiPolynomial"):
        dtm.stability_map(VELOCITY.at(Kp=1, Kv=0), GOOD)
    with pytest.raises(ValueError, match="Td has no value"):
        dtm.stability_map(s + (Kp + Kv * s) * delay(Td), GOOD)
    with pytest.raises(TypeError, match="real numbers"):
        dtm.stability_map(VELOCITY, {"Kp": ["a"], "Kv": (0, 1)})
    with pytest.raises(TypeError, match="dict"):
        dtm.stability_map(VELOCITY, [(0, 1), (0, 1)])
    with pytest.raises(ValueError, match="threads"):
        dtm.stability_map(VELOCITY, GOOD, (2, 2), threads=0)


def test_negative_delays_are_refused_before_any_work():
    told = []
    with pytest.raises(ValueError, match=r"Td=-0\.1.*not be negative"):
        dtm.stability_map(INTEGRATOR, {"Kp": (0, 1), "Td": (-0.1, 1)}, progress=told.append)
    assert told == []
