"""The latency report, on logs with known truth and on recorded flights."""

import re
from dataclasses import replace

import deadtime as dtm
import numpy as np
import pytest
from browser import check_page
from deadtime._base.digits import between, rounded, shown, stated
from deadtime.logs.latencies._contradictions import doubted_by_others
from deadtime.logs.latencies._filters import notch, one_pole, poles_in_row, two_poles
from deadtime.logs.latencies._latency import _told
from deadtime.logs.latencies._live import around_the_vehicle
from deadtime.logs.latencies._relation import relation_of
from deadtime.logs.latencies._windows import others_of, window_of
from flights import flight_path
from hypothesis import given, strategies as st
from made_logs import DELAY, GAIN, LAG, flown_copter
from scipy import signal

#: Length of a log that is only compared, s.
SECONDS = 6.0


def log_of(folder, **options):
    path = folder / "flight.bin"
    path.write_bytes(flown_copter(**options).data)
    return dtm.open_log(path)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return dtm.latency(log_of(tmp_path_factory.mktemp("log"), seconds=8.0))


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    """Another log of the same vehicle."""
    return dtm.latency(log_of(tmp_path_factory.mktemp("log"), seconds=SECONDS, seed=6))


@pytest.fixture(scope="module")
def slow(tmp_path_factory):
    """The time from actuator to response of a vehicle with eight times the delay."""
    log = log_of(tmp_path_factory.mktemp("log"), seconds=SECONDS, delay=8 * DELAY)
    return _told(log, log.loop("roll rate"), "actuator")


def test_the_vehicle_is_told_from_its_own_log(found):
    one = found.loop("roll rate", "actuator")
    value, error, (low, high) = one.sum_of()
    assert low < DELAY + LAG < high
    assert error < 2e-3
    assert one.estimate.verdict == "reliable"
    low, high = one.estimate.ci(0.95, "gain")
    assert low < GAIN < high
    assert value == one.estimate.delay_plus_lag
    assert found.headline() == one.headline()


def test_axes_share_a_delay(found, other):
    # Two axes of one vehicle: two logs of the same loop, with noise of their own.
    both = replace(found, loops=(*found.loops, *other.loops)).shared("rate")
    assert both.verdict == "reliable"
    low, high = both.interval
    assert low < DELAY < high
    each = [one.loop("roll rate", "actuator").estimate.ci() for one in (found, other)]
    assert high - low < min(high - low for low, high in each)
    with pytest.raises(ValueError, match="1 of the 1 loops of rate have a reliable estimate"):
        found.shared("rate")


def test_a_closed_loop_of_second_order_has_a_pair_of_complex_poles(tmp_path):
    # Kp GAIN/(LAG s² + s + Kp GAIN), sampled: damping 0.59. The rate follows a ramp late by
    # 1/(Kp GAIN), and a setpoint that is held by half a period less.
    log = log_of(tmp_path, seconds=SECONDS, delay=0.0, Kp=3.0, seed=5)
    one = dtm.latency(log).loop("roll rate", "setpoint")
    assert one.estimate.verdict == "reliable"
    assert one.estimate.loop.plant.has_pair
    low, high = one.sum_of()[2]
    assert low < 1.0 / (3.0 * GAIN) - 0.5 / 200.0 < high
    assert high - low < 0.01


def test_the_cost_in_gain_holds_that_of_the_true_vehicle(found):
    cost = found.loop("roll rate", "actuator").cost
    true = dtm.ControlLoop(dtm.Integrator(GAIN, LAG), dtm.P(0.9), delay=DELAY)
    largest = dtm.tuning.critical_gain(true)
    assert cost.largest_ci[0] < largest < cost.largest_ci[1]
    assert cost.flown == pytest.approx(0.9, rel=1e-3)
    assert cost.delay_margin == pytest.approx(true.margin().delay_margin, rel=0.15)
    # The gain of a sensitivity peak of 1.7, from its definition.
    omega = np.geomspace(0.1, 1e3, 20_000)
    vehicle = found.loop("roll rate", "actuator").estimate.loop
    G = vehicle.plant.transfer_function().frequency_response(omega)
    G = np.ravel(G) * np.exp(-1j * omega * vehicle.delay)
    assert np.max(1.0 / np.abs(1.0 + cost.well_damped * G)) == pytest.approx(1.7, rel=1e-3)


def test_the_stages_add_up(found):
    stages = found.stages["roll rate"]
    whole = next(one for one in stages if one.name == "controller's command to response")
    parts = [one.time for one in stages if one.part]
    assert sum(parts) == pytest.approx(whole.time)
    names = [one.name for one in stages]
    assert "gyro low-pass" in names
    assert "half a period of the controller" not in names  # each command is in the log
    gyro = stages[names.index("gyro low-pass")]
    assert gyro.time == pytest.approx(np.sqrt(2.0) / (2.0 * np.pi * 20.0))
    assert gyro.source == "INS_GYRO_FILTER 20"


def test_summary_dict_and_page(found, tmp_path):
    text = found.summary()
    assert "roll rate, actuator to response" in text
    assert "a proportional gain is stable up to" in text
    told = found.to_dict()
    assert told["loops"][0]["loop"] == "roll rate"
    assert told["filters"][0]["source"] == "INS_GYRO_FILTER 20"
    own = found.loops[0]
    intervals = told["loops"][0]["estimate"]["interval_95"]
    assert intervals == {"delay+lag": list(own.sum_of()[2])}
    page = found.report(tmp_path / "page.html").read_text(encoding="utf-8")
    page, frames = re.subn(r"<iframe .*?</iframe>", "", page, flags=re.DOTALL)
    assert frames == 1
    assert page.count("<svg") == 1 + len(found.estimated)
    assert "src=" not in page
    assert page.count("<link") == page.count('<link rel="icon" href="data:,">')
    assert found.plot().axes[0].get_xlabel().endswith("[ms]")
    assert "roll rate, actuator to response" in found._repr_html_()


def test_names_from_a_log_are_text_in_the_page(found, tmp_path):
    bad = "<script>alert(1)</script>"
    one = replace(found.loops[0], loop=bad, estimate=None, refusal=bad)
    stages = {bad: found.stages["roll rate"]}
    hostile = replace(found, source=bad, vehicle=bad, loops=(one,), remarks=(bad,), stages=stages)
    page = hostile.report(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<script" not in page
    # Title, heading, vehicle, headline, the stages, the loop with its refusal, the remark.
    assert page.count("&lt;script&gt;") == 7 + len(stages[bad])


@pytest.mark.survey
def test_the_page_in_a_browser(found, tmp_path):
    check_page(found.report(tmp_path / "page.html"))


def test_a_gain_around_the_vehicle_is_shown_where_its_fit_is_reliable(found):
    around = around_the_vehicle(found.estimated)
    one = found.loop("roll rate", "actuator")
    state = around.explorer.state
    assert (state["plant"], state["controller"], state["Kp"]) == ("integrator", "P", one.cost.flown)
    assert state["interval"] == list(one.estimate.ci())
    assert state["x_range"][1] > one.cost.largest
    assert "the gain that is flown" in around.words
    for flown, margin in ((None, None), (one.cost.flown, np.nan)):
        other = replace(one, cost=replace(one.cost, flown=flown, delay_margin=margin))
        assert around_the_vehicle([other]).explorer.state["Kp"] == one.cost.well_damped
    doubted = replace(one, estimate=replace(one.estimate, verdict="indication"))
    assert around_the_vehicle([doubted, found.loop("roll rate")]) is None


def test_north_and_east_that_contradict_each_other_are_not_reliable(found, slow):
    one = found.loop("roll rate", "actuator")
    alike = [replace(one, axis=axis) for axis in ("north", "east")]
    assert all(one.estimate.verdict == "reliable" for one in doubted_by_others(alike))
    apart = [replace(one, axis="north"), replace(slow, axis="east")]
    assert slow.estimate.verdict == "reliable"
    for doubtful in doubted_by_others(apart):
        assert doubtful.estimate.verdict != "reliable"
        assert "contradict each other" in doubtful.estimate.message
    assert all(one.estimate.verdict == "reliable" for one in doubted_by_others([one, slow]))


def test_a_setpoint_that_waits_longer_than_the_actuator_takes_is_not_reliable(found, slow):
    one = found.loop("roll rate", "actuator")
    waits = replace(slow, command="setpoint")
    doubtful, actuator = doubted_by_others([waits, one])
    assert "it would wait" in doubtful.estimate.message
    assert doubtful.estimate.verdict != "reliable"
    assert actuator.estimate.verdict == "reliable"
    for others in ([replace(one, command="setpoint"), one], [waits, replace(one, loop="yaw rate")]):
        assert all(one.estimate.verdict == "reliable" for one in doubted_by_others(others))


def test_the_wait_of_a_real_position_loop_is_doubted():
    """In gusts, 20 s fit best with a wait of 2.4 s, where the actuator takes 1.7 s at most."""
    flight = dtm.latency(
        flight_path("arducopter_2014-10-18_21-19-07.bin"), loops=["north position", "east position"]
    )
    assert "it would wait" in flight.loop("east position").estimate.message
    assert not any(
        one.estimate.verdict == "reliable" for one in flight.estimated if one.command == "setpoint"
    )


def test_without_excitation_every_loop_is_refused_by_name(tmp_path):
    still = dtm.latency(log_of(tmp_path, steps=False, seconds=6.0))
    assert still.estimated == ()
    for one in still.loops:
        assert one.refusal
        assert f"{one.name}: {one.refusal}" in still.summary()
    assert "no loop of flight.bin tells" in still.headline()
    assert still._repr_html_() is None
    with pytest.raises(ValueError, match="no loop tells how long"):
        still.plot()


def test_a_longer_delay_is_seen_as_a_real_change(found, other, tmp_path):
    later = dtm.latency(log_of(tmp_path, seconds=SECONDS, delay=DELAY + 0.010, seed=6))
    changes = dtm.logs.compare_latencies(found, later)
    one = next(one for one in changes if one.command == "actuator")
    assert one.ci[0] < 0.010 < one.ci[1]
    assert one.outcome.startswith("really longer")
    changes = dtm.logs.compare_latencies(found, other)
    one = next(one for one in changes if one.command == "actuator")
    assert one.ci[0] < 0.0 < one.ci[1]
    assert one.to_dict()["outcome"].startswith("no difference is seen")


def test_only_what_is_asked_for(tmp_path):
    log = log_of(tmp_path, seconds=4.0)
    lines = []
    found = dtm.latency(log, axes=("roll",), progress=lines.append)
    assert {one.axis for one in found.loops} == {"roll"}
    assert sorted(lines) == sorted(one.headline() for one in found.loops)
    with pytest.raises(ValueError, match="no loop with the axis 'yaw', it has roll"):
        dtm.latency(log, axes="yaw")
    with pytest.raises(ValueError, match="no time of 'yaw rate' from its setpoint"):
        found.loop("yaw rate")


def test_logs_that_never_fly_are_refused():
    pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    found = dtm.latency(flight_path("px4_sample.ulg"))
    assert found.loops
    assert all("disarmed" in one.refusal for one in found.loops)


def test_a_recorded_rate_sweep():
    flight = dtm.read_recording(
        flight_path("px4_sitl_roll_rate_sweep.csv"),
        time="t_s",
        reference="roll_torque_setpoint",
        output="roll_rate_rad_s",
        command="roll_torque_setpoint",
    )
    # Two seconds of the sweep tell it.
    (one,) = dtm.latency(flight.window(8.0, 10.0)).loops
    value, _, _ = one.sum_of()
    assert 0.016 <= value <= 0.0205  # with half of a hold of 4 ms


def test_a_recorded_flight_is_right_or_says_that_it_is_not():
    found = dtm.latency(flight_path("arducopter_2014-10-18_21-19-07.bin"), loops=("roll", "pitch"))
    # Delay and lag of a fit of held rows, and the peak of the cross-correlation (SOURCES.md).
    for name, fitted, correlated in (("roll", 0.22, 0.27), ("pitch", 0.17, 0.21)):
        one = found.loop(name)
        value, _, (low, high) = one.sum_of()
        assert 0.15 < value < 0.32
        assert one.estimate.verdict != "reliable" or (low < correlated and high > fitted)


def test_a_command_that_moves_between_the_rows_hides_a_short_time():
    # 10 Hz of a rate loop that takes about 40 ms: at 400 Hz the same firmware tells 36 to 41 ms.
    found = dtm.latency(flight_path("ardupilot_sitl_guided_heights.bin"), loops=("roll rate",))
    one = found.loop("roll rate")
    assert one.estimate is not None
    assert one.estimate.verdict != "reliable"
    assert "moves between rows of the log by more than it shows" in one.estimate.message


def test_a_response_of_a_few_steps_of_its_rounding_is_refused():
    found = dtm.latency(flight_path("ardupilot_sitl_guided_heights.bin"), loops=("yaw",))
    for one in found.loops:
        assert "steps of 0.000174533, to which it is rounded" in one.refusal


def test_an_interval_lies_on_both_sides_of_its_estimate():
    pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    # The likelihood of this turn has another minimum, at a delay three times as long.
    fit = dtm.latency(flight_path("px4_sitl_takeoff.ulg"), loops=("pitch",)).loop("pitch").estimate
    for name, value in (("lag_1", fit.loop.plant.lags[0]), ("delay+lag", fit.delay_plus_lag)):
        low, high = fit.ci(0.95, name)
        assert low < value - fit.stderr[name] < value + fit.stderr[name] < high


#: Centre of a notch of 120 Hz, rad/s.
W0 = 2.0 * np.pi * 120.0

# --- filters --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("delay", "num", "den"),
    [
        (one_pole(20.0), [1.0], [1.0 / (2.0 * np.pi * 20.0), 1.0]),
        (two_poles(30.0), *signal.butter(2, 2.0 * np.pi * 30.0, analog=True)),
        (notch(120.0, 4.0), [1.0, 0.0, W0**2], [1.0, W0 / 4.0, W0**2]),
    ],
)
def test_delays_of_filters_are_their_group_delays(delay, num, den):
    omega = np.array([1e-3, 2e-3])
    _, response = signal.freqs(num, den, omega)
    found = -np.diff(np.unwrap(np.angle(response)))[0] / 1e-3
    assert delay == pytest.approx(found, rel=1e-4)


@pytest.mark.parametrize("number", [2, 3])
def test_poles_in_a_row_have_their_corner_together(number):
    corner = 70.0
    own = number / (2.0 * np.pi * poles_in_row(number, corner))
    assert abs(1.0 / (1.0 + 1j * corner / own)) ** number == pytest.approx(np.sqrt(0.5))


# --- digits ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "error", "unit", "text"),
    [
        (0.00342, 0.00005, "s", "3.42 ± 0.05 ms"),
        (0.4302, 0.0151, "s", "430 ± 15 ms"),
        (1.0, 0.0299, "", "1.00 ± 0.03"),
        (0.999, 0.0951, "", "1.00 ± 0.10"),
        (12345.6, 2100.0, "", "12300 ± 2100"),
        (0.0, 0.0, "s", "0 ms"),
        (2.0, float("nan"), "m", "2 m"),
        (1.5, 0.2, "s", "1.50 ± 0.20 s"),
    ],
)
def test_numbers_have_the_digits_of_their_error(value, error, unit, text):
    assert stated(value, error, unit) == text


def test_errors_of_rounding_are_not_shown():
    assert stated(0.1, 1e-16, "s") == "100 ms"
    assert shown(0.1, 1e-16, "s") == "100 ms"
    assert shown(0.10012, 3e-4, "s") == "100.1 ms"
    assert between(0.1, 0.1 + 1e-16, 1e-16, "s") == "100 to 100 ms"
    assert stated(0.1, 1e-9, "s") == "100.0000000 ± 0.0000010 ms"


def test_ends_of_an_interval_have_them_too():
    assert between(0.003312, 0.003529, 0.00005, "s") == "3.31 to 3.53 ms"
    assert between(0.0, 0.0, 0.0, "s") == "0 to 0 ms"


@given(st.floats(-1e6, 1e6), st.floats(1e-9, 1e6))
def test_what_is_left_out_is_less_than_the_error(value, error):
    assert abs(float(rounded(value, error)) - value) <= 0.25 * error + 1e-11


def window_from(start, delay, seed):
    """Twelve seconds of a vehicle with a lag of 0.08 s that follows steps."""
    time = start + 0.01 * np.arange(1200)
    told = 0.2 * np.sign(np.sin(3.7 * (time - start)))
    vehicle = dtm.FactoredPlant([0.08]).transfer_function() * dtm.delay(delay)
    angle = np.ravel(vehicle.simulate(time - start, told).outputs)
    noise = 0.003 * np.random.default_rng(seed).standard_normal(time.size)
    return window_of(dtm.Recording(time, told, angle + noise, told), integrates=False)


def test_a_window_that_contradicts_the_estimate_makes_it_doubtful():
    used, alike, later = (window_from(20.0 * k, (0.03, 0.03, 0.04)[k], k) for k in range(3))

    def estimate(*others):
        found = relation_of("roll", "roll", "attitude", "setpoint", [used], others=others)
        return found.estimate

    assert estimate(alike).verdict == "reliable"
    doubted = estimate(alike, later)
    assert doubted.verdict != "reliable"
    why = "the window from 40.0 to 52.0 s of the log contradicts it: delay and lag are 119.8"
    assert why in doubted.message


def test_windows_that_share_rows_are_not_compared():
    best, second, third, fourth = (window_from(6.0 * k, 0.03, k) for k in range(4))
    assert others_of([best, second, third, fourth], [best]) == [third]
    assert others_of([best, third._replace(promise=np.inf, explained=0.0)], [best]) == []


def test_a_turn_that_takes_longer_makes_a_recorded_flight_doubtful():
    """Most of the flight fits 0.25 s, a window of it 0.35 s and more."""
    flight = dtm.latency(flight_path("arducopter_2014-10-18_21-19-07.bin"), loops=["roll"])
    roll = flight.loop("roll").estimate
    assert roll.verdict != "reliable"
    assert "the window from 47.5 to 51.4 s of the log contradicts it" in roll.message
