"""The latency report, on logs with known truth and on recorded flights."""

import re
from dataclasses import replace

import deadtime as dtm
import numpy as np
import pytest
from browser import check_page
from deadtime.logs.latencies._contradictions import doubted_by_others
from deadtime.logs.latencies._latency import latency_of
from deadtime.logs.latencies._live import around_the_vehicle
from flights import flight_path
from made_logs import DELAY, GAIN, LAG, flown_copter

#: Length of a log that is only compared, s, and time between commands of the controller, s.
SECONDS, PERIOD = 6.0, 0.005


def of_vehicle(one, delay=DELAY):
    """The true time from the command of the controller, at the frequencies of an answer, s."""
    omega = one.frequencies
    return float((delay + np.arctan(LAG * omega) / omega) @ one.weights)


def of_loop(one, Kp=0.9, delay=DELAY):
    """The same from the setpoint: Kp G(s)/(1 + Kp L(z)), L the samples of G behind a hold.

    L is the sum of G with its hold over all frequencies that look alike at the samples.
    """
    omega = np.linspace(0.05, one.frequencies[-1], 3000)

    def vehicle(s):
        return GAIN * np.exp(-s * delay) / (s * (LAG * s + 1.0))

    s = 1j * (omega + 2.0 * np.pi / PERIOD * np.arange(-100, 101)[:, None])
    sampled = np.sum(vehicle(s) * -np.expm1(-s * PERIOD) / (s * PERIOD), axis=0)
    phase = np.unwrap(np.angle(Kp * vehicle(1j * omega) / (1.0 + Kp * sampled)))
    return float(np.interp(one.frequencies, omega, -phase / omega) @ one.weights)


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
    return latency_of(log, log.loop("roll rate"), "actuator")


def test_the_time_of_the_vehicle_is_known_from_its_own_log(found, slow):
    one = found.loop("roll rate", "actuator")
    assert (one.verdict, one.reason) == ("reliable", "")
    for each, delay in ((one, DELAY), (slow, 8 * DELAY)):
        low, high = each.interval
        assert low < of_vehicle(each, delay) < high
        assert high - low < 2e-3 + 0.1 * each.time
        # Between half of the largest gain that is stable and the true crossover of it.
        assert each.frequencies == pytest.approx([each.estimate.crossover])
    low, high = one.estimate.ci(0.95, "gain")
    assert low < GAIN < high
    assert found.headline() == one.headline()


def test_a_closed_loop_has_the_mean_of_its_equivalent_delay(found, other):
    for each in (found, other):
        one = each.loop("roll rate", "setpoint")
        low, high = one.interval
        assert one.verdict == "reliable"
        assert low < of_loop(one) < high
        assert high - low < 2e-3
        # Nearly all of a doublet of 1.1 s is in its first harmonics.
        assert one.weights.sum() == pytest.approx(1.0)
        assert one.weights @ one.frequencies < 6.0 * 2.0 * np.pi / 1.1


def test_a_closed_loop_of_second_order_has_a_pair_of_complex_poles(tmp_path):
    # Kp GAIN/(LAG s² + s + Kp GAIN), sampled: damping 0.59.
    log = log_of(tmp_path, seconds=SECONDS, delay=0.0, Kp=3.0, seed=5)
    one = latency_of(log, log.loop("roll rate"), "setpoint")
    assert one.verdict == "reliable"
    assert "oscillates" in one.estimate.best.in_words()
    low, high = one.interval
    assert low < of_loop(one, 3.0, 0.0) < high
    assert high - low < 0.05 * one.time


def test_the_cost_in_gain_holds_that_of_the_true_vehicle(found):
    one = found.loop("roll rate", "actuator")
    cost = one.cost
    true = dtm.ControlLoop(dtm.Integrator(GAIN, LAG), dtm.P(0.9), delay=DELAY)
    largest = dtm.tuning.critical_gain(true)
    assert cost.largest_ci[0] < largest < cost.largest_ci[1]
    assert cost.flown == pytest.approx(0.9, rel=1e-3)
    assert cost.delay_margin == pytest.approx(true.margin().delay_margin, rel=0.15)
    # The gain of a sensitivity peak of 1.7, from its definition.
    omega = np.geomspace(0.1, 1e3, 20_000)
    G = np.ravel(one.estimate.plant.transfer_function().frequency_response(omega))
    G = G * np.exp(-1j * omega * one.estimate.delay)
    assert np.max(1.0 / np.abs(1.0 + cost.well_damped * G)) == pytest.approx(1.7, rel=1e-3)
    assert found.loop("roll rate", "setpoint").cost is None


def test_the_stages_add_up(found):
    stages = found.stages["roll rate"]
    whole = next(one for one in stages if one.name == "controller's command to response")
    parts = [one.time for one in stages if one.part]
    assert sum(parts) == pytest.approx(whole.time)
    gyro = stages[[one.name for one in stages].index("gyro low-pass")]
    assert gyro.time == pytest.approx(np.sqrt(2.0) / (2.0 * np.pi * 20.0))
    assert gyro.source == "INS_GYRO_FILTER 20"


def test_summary_dict_and_page(found, tmp_path):
    text = found.summary()
    assert text.startswith("flight.bin: ArduPilot Copter")
    own = found.loop("roll rate", "setpoint")
    assert [line.split()[:2] for line in text.splitlines()[3:5]] == [
        ["roll", "rate"], ["roll", "rate"],
    ]  # fmt: skip
    in_full = found.details()
    assert "a proportional gain is stable up to" in in_full
    assert "roll rate, setpoint to response" in in_full
    told = found.to_dict()
    assert told["filters"][0]["source"] == "INS_GYRO_FILTER 20"
    first = told["loops"][0]
    assert (first["loop"], first["command"], first["time"]) == ("roll rate", "setpoint", own.time)
    assert first["interval_95"] == list(own.interval)
    assert first["estimate"]["verdict"] == own.estimate.verdict
    assert set(first["plain"]) == {"cross-correlation", "deconvolved step", "moves"}
    assert replace(own, verdict="indication").to_dict()["interval_95"] is None
    page = found.report(tmp_path / "page.html").read_text(encoding="utf-8")
    page, frames = re.subn(r"<iframe .*?</iframe>", "", page, flags=re.DOTALL)
    assert frames == 1
    # One of all loops, a fit each, and the moves of the setpoint.
    assert page.count("<svg") == 1 + len(found.estimated) + 1
    assert "src=" not in page
    assert page.count("<link") == page.count('<link rel="icon" href="data:,">')
    assert found.plot().axes[0].get_xlabel().endswith("[ms]")
    assert "flight.bin: ArduPilot Copter" in found._repr_html_()


def test_names_from_a_log_are_text_in_the_page(found, tmp_path):
    bad = "<script>alert(1)</script>"
    one = replace(found.loops[0], loop=bad, verdict="none", estimate=None, reason=bad)
    stages = {bad: found.stages["roll rate"]}
    hostile = replace(found, source=bad, vehicle=bad, loops=(one,), remarks=(bad,), stages=stages)
    page = hostile.report(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<script" not in page
    # Title, heading, vehicle, headline, the stages, the loop with its reason, the remark.
    assert page.count("&lt;script&gt;") >= 7 + len(stages[bad])


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
    assert "the gain that the vehicle uses" in around.words
    for flown, margin in ((None, None), (one.cost.flown, np.nan)):
        other = replace(one, cost=replace(one.cost, flown=flown, delay_margin=margin))
        assert around_the_vehicle([other]).explorer.state["Kp"] == one.cost.well_damped
    doubted = replace(one, verdict="indication")
    assert around_the_vehicle([doubted, found.loop("roll rate")]) is None


def test_north_and_east_that_contradict_each_other_are_not_reliable(found, slow):
    one = found.loop("roll rate", "actuator")
    alike = [replace(one, axis=axis) for axis in ("north", "east")]
    assert all(one.verdict == "reliable" for one in doubted_by_others(alike))
    apart = [replace(one, axis="north"), replace(slow, axis="east")]
    assert slow.verdict == "reliable"
    for doubtful in doubted_by_others(apart):
        assert doubtful.verdict == "indication"
        assert "contradict each other" in doubtful.reason
    assert all(one.verdict == "reliable" for one in doubted_by_others([one, slow]))


def test_a_setpoint_at_rest_shows_no_time(tmp_path):
    still = dtm.latency(log_of(tmp_path, steps=False, seconds=6.0))
    # What the noise makes the controller command moves the vehicle, too.
    one = still.loop("roll rate", "actuator")
    assert one.verdict != "reliable" or one.interval[0] < of_vehicle(one) < one.interval[1]
    one = still.loop("roll rate", "setpoint")
    assert (one.verdict, one.shown()) == ("none", "—")
    assert one.reason == "the setpoint does not move"
    none = replace(still, loops=(one,))
    assert none.estimated == ()
    assert f"none: roll rate: {one.reason}" in none.details()
    assert one.reason in none.summary()
    assert none.headline().startswith("none: no loop of flight.bin shows")
    assert none._repr_html_() is None
    with pytest.raises(ValueError, match="no loop has a time"):
        none.plot()


def test_a_longer_delay_is_seen_as_a_real_change(found, other, tmp_path):
    later = dtm.latency(log_of(tmp_path, seconds=SECONDS, delay=DELAY + 0.010, seed=6))
    changes = dtm.logs.compare_latencies(found, later)
    one = next(one for one in changes if one.command == "actuator")
    # It crosses over at another frequency: their own times differ by 12 ms.
    assert one.ci[0] < 0.010 < one.ci[1]
    assert one.outcome.startswith("longer, and not by chance")
    changes = dtm.logs.compare_latencies(found, other)
    one = next(one for one in changes if one.command == "actuator")
    assert one.ci[0] < 0.0 < one.ci[1]
    assert one.to_dict()["outcome"].startswith("no difference was found")


def test_only_what_is_asked_for(tmp_path):
    log = log_of(tmp_path, seconds=4.0)
    each = []
    found = dtm.latency(log, axes=("roll",), progress=each.append)
    assert {one.axis for one in found.loops} == {"roll"}
    assert each == list(found.loops)
    with pytest.raises(ValueError, match=r"no loop with the axis 'yaw'\. It has roll"):
        dtm.latency(log, axes="yaw")
    with pytest.raises(ValueError, match="'yaw rate' has no time from its setpoint"):
        found.loop("yaw rate")


def test_logs_that_never_fly_are_refused():
    pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    found = dtm.latency(flight_path("px4_sample.ulg"))
    assert found.loops
    assert all("disarmed" in one.reason for one in found.loops)


def test_a_recorded_rate_sweep():
    flight = dtm.read_recording(
        flight_path("px4_sitl_roll_rate_sweep.csv"),
        time="t_s",
        reference="roll_torque_setpoint",
        output="roll_rate_rad_s",
        command="roll_torque_setpoint",
    )
    # Published least squares: 17.7 ms behind a lead of -0.4 ms, with half of a hold of 4 ms in
    # it or not. Two seconds of the sweep show it.
    (one,) = dtm.latency(flight.window(8.0, 10.0)).loops
    low, high = one.interval
    assert one.verdict != "reliable" or (low < 0.0181 and high > 0.0161)
    assert 0.016 <= one.time <= 0.0205


def test_a_recorded_flight_is_right_or_says_that_it_is_not():
    found = dtm.latency(flight_path("arducopter_2014-10-18_21-19-07.bin"), loops=("roll", "pitch"))
    # Delay and lag of a fit of held rows, and the peak of the cross-correlation (SOURCES.md).
    for name, fitted, correlated in (("roll", 0.22, 0.27), ("pitch", 0.17, 0.21)):
        one = found.loop(name)
        low, high = one.interval
        assert 0.15 < one.time < 0.32
        assert one.verdict != "reliable" or (low < correlated and high > fitted)


def test_rows_that_are_rare_against_the_time_say_little():
    # 10 Hz of a rate loop that takes about 40 ms: at 400 Hz the same firmware takes 36 to 41 ms.
    found = dtm.latency(flight_path("ardupilot_sitl_guided_heights.bin"), loops=("roll rate",))
    one = found.loop("roll rate")
    low, high = one.interval
    assert one.verdict != "reliable" or (low < 0.036 and high > 0.041)
    assert high - low > 0.05


def test_a_response_that_hardly_moves_shows_no_time():
    # It moves by less than the degree that its setpoint does, in steps of a hundredth of one.
    found = dtm.latency(flight_path("ardupilot_sitl_guided_heights.bin"), loops=("yaw",))
    assert not found.estimated
    assert all(one.reason for one in found.loops)


def test_a_bump_test_is_sent_to_the_commands_for_a_process():
    time = np.arange(600.0)
    heater = np.where(time < 50.0, 40.0, 45.0)
    warmth = 9.0 * -np.expm1(-np.maximum(time - 62.0, 0.0) / 40.0)
    warmth += np.random.default_rng(1).normal(0.0, 0.05, time.size)
    found = dtm.latency(dtm.Recording(time, None, warmth, heater, source="bump.csv"))
    (one,) = found.loops
    assert one.verdict == "none"
    assert one.reason == "the actuator moves in 1 of 8 parts of the recording, but a time needs 4"
    (further,) = found.advice
    assert "deadtime estimate" in further.text
    assert "deadtime tune" in further.text
    assert further.text in found.below()[-1]
