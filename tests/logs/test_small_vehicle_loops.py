"""Loops in logs of Betaflight, INAV and a Crazyflie, opened by their first bytes."""

from dataclasses import replace

import deadtime as dtm
import numpy as np
import pytest
from blackbox_logs import END, SIGNED, UNSIGNED, Log, rate_log, rate_rows
from crazyflie_logs import definitions, record, sealed
from deadtime.logs.latencies._latency import latency_of
from flights import flight_path
from sampled_loops import RATE, fly

DEGREE = np.pi / 180.0
STATES = [
    ("flightModeFlags", 0, (0, UNSIGNED)),
    *((name, 0, (0, UNSIGNED)) for name in ("stateFlags", "failsafePhase")),
]


def opened(tmp_path, data):
    path = tmp_path / "log"
    path.write_bytes(data)
    return dtm.open_log(path)


def test_rates_of_betaflight(tmp_path):
    log = rate_log()
    rows = rate_rows(400, np.random.default_rng(0))
    frames = [log.main(rows[0]), log.slow_frame([1, 0, 0, 1, 1]), *map(log.main, rows[1:300])]
    frames += [log.slow_frame([0, 0, 0, 1, 1]), *map(log.main, rows[300:])]
    found = opened(tmp_path, log.head() + b"".join(frames) + END)
    assert list(found.loops) == ["roll rate", "pitch rate", "yaw rate"]
    roll, yaw = found.loops["roll rate"], found.loops["yaw rate"]
    truth = {name: np.array(rows, dtype=float)[:, k] for k, name in enumerate(log.names)}
    np.testing.assert_allclose(roll.setpoint.values, DEGREE * truth["setpoint[0]"], rtol=1e-14)
    np.testing.assert_allclose(yaw.response.values, DEGREE * truth["gyroADC[2]"], rtol=1e-14)
    assert roll.setpoint.unit == "rad/s"
    # Yaw has no D term.
    total = sum(truth[f"axis{term}[0]"] for term in "PIDF")
    np.testing.assert_array_equal(roll.actuator.values, total)
    total = sum(truth[f"axis{term}[2]"] for term in "PIF")
    np.testing.assert_array_equal(yaw.actuator.values, total)
    # It is followed until the vehicle is disarmed.
    (segment,) = roll.segments
    start = rows[0][1] * 1e-6
    assert segment[1] == pytest.approx(rows[300][1] * 1e-6 - start, abs=3e-4)


def inav_log(flags):
    names = [f"{name}[{k}]" for name in ("axisRate", "gyroADC") for k in range(3)]
    names += [f"nav{name}[{k}]" for name in ("TgtVel", "Vel", "TgtPos", "Pos") for k in range(3)]
    log = Log(
        fields=[(name, 1, (0, SIGNED), (1, SIGNED)) for name in names],
        revision="INAV 7.1.2 (a1b2c3d) MATEKF405",
        slow=STATES,
    )
    random = np.random.default_rng(0)
    rows = [[k, 1_000_000 + 2000 * k, *map(int, random.integers(-90, 90, 18))] for k in range(200)]
    frames = [log.main(rows[0]), log.slow_frame([flags, 0, 0]), *map(log.main, rows[1:])]
    return log, rows, log.head() + b"".join(frames) + END


def test_rates_velocities_and_positions_of_inav(tmp_path):
    log, rows, data = inav_log(1 | 1 << 9)
    found = opened(tmp_path, data)
    assert list(found.loops)[:4] == ["roll rate", "pitch rate", "yaw rate", "north velocity"]
    assert len(found.loops) == 9
    climb = found.loops["vertical speed"]
    truth = np.array(rows, dtype=float)[:, log.names.index("navVel[2]")]
    np.testing.assert_allclose(climb.response.values, 0.01 * truth, rtol=1e-14)
    assert climb.response.unit == "m/s"
    assert all(loop.segments for loop in found.loops.values())


@pytest.mark.parametrize(
    ("bits", "followed"),
    [
        (1 << 3, {"roll rate", "vertical speed", "altitude"}),
        (1 << 1, {"roll rate"}),
        (1 << 10, set()),
    ],
    ids=["altitude hold", "angle", "manual"],
)
def test_loops_that_the_mode_of_inav_closes(tmp_path, bits, followed):
    _, _, data = inav_log(1 | bits)
    loops = opened(tmp_path, data).loops
    asked = {"roll rate", "vertical speed", "altitude", "east velocity", "north position"}
    assert {name for name in asked if loops[name].segments} == followed


def test_loops_of_a_crazyflie(tmp_path):
    names = ["controller.pitchRate", "gyro.y", "controller.yaw", "stabilizer.yaw"]
    names += ["posCtl.targetZ", "stateEstimateZ.z", "stabilizer.thrust"]
    letters = "ffffhhf"
    events = {1: ("fixedFrequency", list(zip(names, letters, strict=True)))}
    random = np.random.default_rng(0)
    rows = [[*random.normal(0, 20, 2), 175 + k % 10, k % 10 - 180, 1, 950 + k % 9, 4e4]
            for k in range(300)]  # fmt: skip
    frames = (record(events, 1, 1_000_000 + 2000 * k, row) for k, row in enumerate(rows))
    found = opened(tmp_path, sealed(definitions(events) + b"".join(frames)))
    assert list(found.loops) == ["pitch rate", "yaw", "altitude"]
    truth = np.float32(rows).astype(float)
    pitch = found.loops["pitch rate"]
    # The controller counts pitch against the y axis of the gyroscope.
    np.testing.assert_allclose(pitch.response.values, -DEGREE * truth[:, 1], rtol=1e-12)
    np.testing.assert_allclose(pitch.setpoint.values, DEGREE * truth[:, 0], rtol=1e-12)
    height = found.loops["altitude"]
    np.testing.assert_allclose(height.response.values, 1e-3 * truth[:, 5], rtol=1e-12)
    assert all(loop.segments for loop in found.loops.values())


def crazyflie_log(columns):
    """A log with these columns, at 500 rows a second."""
    events = {1: ("fixedFrequency", [(name, "f") for name in columns])}
    rows = zip(*columns.values(), strict=True)
    frames = (record(events, 1, 1_000_000 + 2000 * k, row) for k, row in enumerate(rows))
    return sealed(definitions(events) + b"".join(frames))


def motors(thrust, roll, pitch, yaw):
    """The mixer of the firmware: motors 1 and 2 are on the right, 1 and 4 in front."""
    right, front = 0.5 * np.array(roll), 0.5 * np.array(pitch)
    return {
        "motor.m1": thrust - right + front + yaw,
        "motor.m2": thrust - right - front - yaw,
        "motor.m3": thrust + right - front + yaw,
        "motor.m4": thrust + right + front - yaw,
    }


@pytest.mark.parametrize("logged", ["commands", "motors"])
def test_what_the_controllers_of_a_crazyflie_command(tmp_path, logged):
    random = np.random.default_rng(0)
    commands = {name: random.integers(-900, 900, 300) * 2.0 for name in ("roll", "pitch", "yaw")}
    thrust = 40_000.0 + random.integers(-900, 900, 300)
    columns = {f"controller.{axis}Rate": random.normal(0, 20, 300) for axis in commands}
    columns |= {f"gyro.{letter}": random.normal(0, 20, 300) for letter in "xyz"}
    names = ["posCtl.targetVX", "posCtl.bodyVX", "controller.pitch", "posCtl.targetVY"]
    names += ["posCtl.bodyVY", "controller.roll", "posCtl.targetVZ", "stateEstimate.vz"]
    names += ["ctrltarget.z", "stateEstimate.z", "stateEstimateZ.ratePitch"]
    columns |= {name: random.normal(0, 1, 300) for name in names}
    if logged == "motors":
        columns |= motors(thrust, **commands)
    else:
        columns |= {f"controller.cmd_{axis}": values for axis, values in commands.items()}
        columns |= {"stabilizer.thrust": thrust}
    loops = opened(tmp_path, crazyflie_log(columns)).loops
    for axis, values in commands.items():
        # The firmware turns the sign of the yaw command behind its controller.
        told = -values if axis == "yaw" else values
        np.testing.assert_allclose(loops[f"{axis} rate"].actuator.values, told, rtol=1e-6)
    np.testing.assert_allclose(loops["vertical speed"].actuator.values, thrust, rtol=1e-6)
    # The controller tilts against the velocity that it wants.
    for axis, tilt in (("x", "pitch"), ("y", "roll")):
        told = -DEGREE * np.float32(columns[f"controller.{tilt}"])
        np.testing.assert_allclose(loops[f"{axis} velocity"].actuator.values, told, rtol=1e-6)
    altitude = loops["altitude"]
    np.testing.assert_allclose(altitude.setpoint.values, columns["ctrltarget.z"], rtol=1e-6)
    assert altitude.actuator.source == "fixedFrequency.posCtl.targetVZ"


def test_the_estimator_of_a_crazyflie_counts_pitch_as_its_controller(tmp_path):
    rate = np.random.default_rng(0).normal(0, 20, 300)
    columns = {"controller.pitchRate": rate, "stateEstimateZ.ratePitch": 1e3 * DEGREE * rate}
    loop = opened(tmp_path, crazyflie_log(columns)).loops["pitch rate"]
    np.testing.assert_allclose(loop.response.values, loop.setpoint.values, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("axis", ["roll", "yaw"])
def test_the_time_from_the_motors_of_a_crazyflie_to_its_rate(tmp_path, axis):
    flight = fly(replace(RATE, period=0.002, seconds=2.0), np.random.default_rng(4))
    sent = dict.fromkeys(("roll", "pitch", "yaw"), np.zeros(flight.time.size))
    sent[axis] = 2000.0 * flight.sent / np.max(np.abs(flight.sent))
    if axis == "yaw":
        sent[axis] = -sent[axis]
    columns = {
        f"controller.{axis}Rate": flight.setpoint / DEGREE,
        {"roll": "gyro.x", "yaw": "gyro.z"}[axis]: flight.read / DEGREE,
        **motors(40_000.0, **sent),
    }
    log = opened(tmp_path, crazyflie_log(columns))
    one = latency_of(log, log.loop(f"{axis} rate"), "actuator")
    low, high = one.interval
    assert one.verdict == "reliable", one.reason
    assert low < flight.delay_at(one.frequencies) @ one.weights < high


def test_a_real_log_of_betaflight_has_its_rate_loops():
    found = dtm.open_log(flight_path("betaflight_error_recovery.bbl"))
    assert list(found.loops) == ["roll rate", "pitch rate", "yaw rate"]
    assert "Betaflight" in found.summary()


def test_a_real_log_of_motors_and_gyroscope_has_no_loop():
    found = dtm.open_log(flight_path("crazyflie_log10.cfusd"))
    assert not found.loops
    assert found.summary().startswith("crazyflie_log10.cfusd: Crazyflie uSD, 50.01 s, Crazyflie")
