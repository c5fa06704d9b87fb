"""A range means the same in every function: `(low, high)` or `(low, high, n)`, tuple or list."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime import delay, s
from deadtime._base.validation import given_points, interval, is_range, open_interval

Kp, Kv, T = dtm.parameters("Kp Kv T")
VELOCITY = s + (Kp + Kv * s) * delay(T)
LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.3), delay=0.36)
FAST = {"threads": 1}

#: Functions that take a range of one parameter, each with a part of the result to compare.
ASKED = {
    "map": lambda r: dtm.stability_map(
        VELOCITY, {"Kp": r, "Kv": (0, 0.5)}, (4, 3), at={"T": 0.36}, **FAST
    ),
    "robust": lambda r: dtm.robust_map(
        VELOCITY, {"Kp": r, "Kv": (0.1, 0.5)}, {"T": [0.3, 0.36]}, (4, 3), **FAST
    ),
    "boxes": lambda r: dtm.proved_boxes(VELOCITY, {"Kp": r}, at={"Kv": 0.3, "T": 0.36}, **FAST),
    "crossings": lambda r: dtm.crossings(VELOCITY, {"Kp": r}, at={"Kv": 0.3, "T": 0.36}),
    "design": lambda r: (
        dtm.design(LOOP, controller=dtm.P, ranges={"Kp": r}, objective="abscissa").loop
    ),
    "region": lambda r: (s + delay(1.0)).roots(re=(-3, 2), im=r),
}


@pytest.mark.parametrize("ask", ASKED.values(), ids=ASKED)
def test_a_list_and_a_tuple_are_the_same_range(ask):
    assert ask((0.5, 6.0)) == ask([0.5, 6.0])


def test_a_range_may_say_its_points():
    asked = {"Kp": (0.5, 6, 7), "Kv": [-0.5, 0.5]}
    chart = dtm.stability_map(VELOCITY, asked, shape=(4, 3), at={"T": 0.36})
    assert chart.unstable.shape == (7, 3)
    np.testing.assert_array_equal(chart.axes["Kp"], np.linspace(0.5, 6, 7))


def test_what_is_no_range_holds_the_points():
    four = [0.0, 1.0, 2.0, 3.0]
    for points in (four, np.array(four[:2]), np.array(four[:3]), [1.0]):
        assert not is_range(points)
        np.testing.assert_array_equal(given_points("x", points, 9), points)
    np.testing.assert_array_equal(given_points("x", [0, 1], 3), [0.0, 0.5, 1.0])


def test_three_numbers_are_no_points_unawares():
    with pytest.raises(TypeError, match=r"numpy\.array"):
        given_points("x", [1.0, 2.0, 9.0])
    with pytest.raises(ValueError, match=r"\(low, high, n\)"):
        given_points("x", (1.0, 2.0))
    with pytest.raises(ValueError, match="only the two ends of the range"):
        interval("x", (1.0, 2.0, 5))


def test_a_value_belongs_in_at():
    with pytest.raises(TypeError, match="at="):
        dtm.stability_map(VELOCITY, {"Kp": (0, 1), "Kv": 0.2}, at={"T": 0.1})
    with pytest.raises(TypeError, match="give a range"):
        dtm.proved_boxes(VELOCITY, {"Kp": (0, 1), "Kv": 0.2}, at={"T": 0.1})
    with pytest.raises(ValueError, match="has a range, and also a value"):
        dtm.proved_boxes(VELOCITY, {"Kp": (0, 1), "T": (0, 1)}, at={"T": 0.1, "Kv": 0.0})


@pytest.mark.parametrize("bad", [3.0, (1.0,), (1.0, 2.0, 3.0), ("a", 1.0), ((0, 1), (2, 3)), "ab"])
def test_ends_of_a_region_are_a_pair(bad):
    with pytest.raises(TypeError, match="For an open end"):
        open_interval("re", bad)


@pytest.mark.parametrize("sample_time", [None, 0.065])
def test_numbers_of_a_loop_are_replaced_by_at(sample_time):
    loop = LOOP.replace(sample_time=sample_time)
    asked = {"Kp": (0.5, 6), "Kv": (0.1, 0.5)}
    one = dtm.stability_map(loop, asked, (5, 4), at={"delay": 0.2})
    other = dtm.stability_map(loop.replace(delay=0.2), asked, (5, 4))
    np.testing.assert_array_equal(one.unstable, other.unstable)
    np.testing.assert_allclose(one.abscissa, other.abscissa, rtol=1e-9)


def test_boxes_and_radii_of_a_loop_with_numbers_replaced():
    found = dtm.stability_radius(LOOP, {"Kp": 2.0}, at={"delay": 0.2, "Kv": 0.0})
    plain = dtm.stability_radius(LOOP.replace(delay=0.2, controller=dtm.P(2.0)), {"Kp": 2.0})
    assert found.radius == pytest.approx(plain.radius, rel=2e-3)
    box = dtm.largest_stable_box(LOOP, {"Kp": (0.1, 9)}, at={"Kv": 0.0})
    assert box["Kp"][1] == pytest.approx(0.5 * np.pi / 0.36, abs=0.02)


def test_a_window_may_be_a_list(tmp_path):
    path = tmp_path / "run.csv"
    rows = [f"{0.1 * i:.1f},{int(i > 20)},{0.01 * i}" for i in range(100)]
    path.write_text("\n".join(["t,r,y", *rows]), encoding="utf-8")
    names = {"time": "t", "reference": "r", "output": "y"}
    one, other = (
        dtm.read_recording(path, **names, window=window) for window in ([1, None], (1, None))
    )
    assert one == other
    assert one.time[0] == 1.0
