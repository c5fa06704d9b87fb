"""Navdata of the emulated AR.Drone 2.0 in flight, and the dynamics of its plants."""

import functools
import math
from itertools import pairwise

import deadtime as dtm
import numpy as np
import pytest
from deadtime.links.ardrone2.commands import (
    Config,
    Move,
    Ref,
    Watchdog,
)
from deadtime.links.ardrone2.emulator import (
    EmulatorOptions,
    Thruster,
    ThrustMotion,
)
from deadtime.links.ardrone2.emulator.motion import GRAVITY, LINEAR_PLANTS, LinearMotion
from deadtime.links.ardrone2.navdata import parse_navdata
from hypothesis import given, settings, strategies as st
from pilot import DOWN, UP, Pilot, configured

# --- navdata ---------------------------------------------------------------------------------


def test_short_and_long_packets_and_their_rates():
    pilot = Pilot().connect()
    pilot.wait(1.0, Watchdog())
    pilot.sent.clear()
    pilot.wait(10.0, Watchdog())
    assert {len(packet) for packet in pilot.sent} == {500}
    assert len(pilot.sent) == 150
    pilot.send(Config("general:navdata_demo", "FALSE"))
    pilot.sent.clear()
    pilot.wait(10.0, Watchdog())
    assert {len(packet) for packet in pilot.sent} == {2190}
    assert len(pilot.sent) == 2000
    clocks = [parse_navdata(packet).clock for packet in pilot.sent]
    assert np.allclose(np.diff(clocks), 0.005, atol=1e-9)


def test_options_of_short_packets_can_be_chosen():
    pilot = Pilot().connect()
    configured(pilot, "general:navdata_options", str(1 << 0 | 1 << 9 | 1 << 24))
    pilot.wait(0.2, Watchdog())
    assert [tag for tag, _ in pilot.last.options if tag != 0xFFFF] == [0, 9, 24]
    assert len(pilot.sent[-1]) == 16 + 148 + 92 + 72 + 8
    assert pilot.last.clock is None


def test_the_setpoint_appears_in_navdata_when_it_reaches_the_vehicle():
    pilot = Pilot().connect(demo=False).fly()
    commanded = pilot.time
    pilot.sent.clear()
    pilot.wait(1.0, UP, Move(gaz=0.5), every=0.02)
    parsed = [parse_navdata(packet) for packet in pilot.sent]
    follows = [one.clock for one in parsed if one.climb_setpoint > 0.0]
    assert min(follows) == pytest.approx(commanded + 0.02 + 0.26, abs=0.005)
    last = parsed[-1]
    assert last.climb_setpoint == pytest.approx(0.35)
    assert last.climb == pytest.approx(pilot.truth.climb, abs=1e-4)
    assert last.altitude.altitude_vz == pytest.approx(-last.kalman_pressure.est_zdot)
    assert last.height == pytest.approx(pilot.truth.height, abs=6e-4)
    assert last.kalman_pressure.est_z == pytest.approx(pilot.truth.height, abs=1e-6)


def test_the_ultrasonic_height_changes_25_times_a_second():
    pilot = Pilot(noise=0.003).connect(demo=False).fly()
    pilot.sent.clear()
    pilot.wait(4.0, UP)
    raw = [parse_navdata(packet).altitude.altitude_raw for packet in pilot.sent]
    changes = sum(a != b for a, b in pairwise(raw))
    assert 70 <= changes <= 100  # The resolution is a millimetre, so some values repeat.


def accelerations(pilot):
    measures = pilot.last.physical_measures
    return measures.acceleration_x, measures.acceleration_y, measures.acceleration_z


def test_accelerometers_measure_one_g_at_rest_and_in_hover():
    """An accelerometer measures specific force, which is g unless the drone falls freely."""
    pilot = Pilot().connect(demo=False)
    pilot.wait(0.1, Watchdog())
    assert accelerations(pilot) == pytest.approx((0.0, 0.0, -1.0), abs=1e-6)
    raw = pilot.last.raw_measures
    counts = (raw.acceleration_x, raw.acceleration_y, raw.acceleration_z)
    assert counts == (2048, 2048, 2560)  # As recorded, within sensor offsets.
    pilot.fly()
    assert accelerations(pilot) == pytest.approx((0.0, 0.0, -1.0), abs=1e-4)


@pytest.mark.parametrize("plant", ["kit", "thrust"])
def test_accelerometers_measure_the_change_of_the_climb(plant):
    pilot = Pilot(plant=plant, delay=0.0).connect(demo=False).fly()
    pilot.sent.clear()
    pilot.wait(2.0, UP, Move(gaz=0.5))
    parsed = [parse_navdata(packet) for packet in pilot.sent]
    measured = np.array([packet.physical_measures.acceleration_z for packet in parsed])
    climb = np.array([packet.kalman_pressure.est_zdot for packet in parsed])
    gained = np.cumsum(-measured[1:] - 1.0) * GRAVITY * 0.005
    assert gained == pytest.approx(climb[1:] - climb[0], abs=0.002)
    pilot.send(Ref(take_off=True, emergency=True))  # In free fall.
    pilot.wait(0.1, Ref(take_off=True, emergency=True))
    assert accelerations(pilot) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_navdata_give_the_number_of_the_last_ref():
    pilot = Pilot().connect(demo=False)
    pilot.send(Watchdog(), DOWN, Watchdog())
    pilot.wait(0.01)
    assert pilot.last.video_stream.atcmd_ref_seq == pilot.number - 2


def test_angles_follow_commands_and_the_height_stays():
    pilot = Pilot().connect(demo=False).fly()
    before = pilot.truth.height
    pilot.wait(3.0, UP, Move(roll=0.5, pitch=-1.0, yaw=1.0))
    largest = pilot.drone.settings.angle_limit
    assert pilot.last.roll == pytest.approx(0.5 * largest, abs=1e-4)
    assert pilot.last.pitch == pytest.approx(-largest, abs=1e-4)
    assert pilot.last.demo.vx > 0.5
    assert pilot.last.demo.vy > 0.25
    assert pilot.last.yaw != 0.0
    assert pilot.truth.height == pytest.approx(before, abs=1e-9)


@functools.cache
def undisturbed_flight(seed, plant):
    return noisy_flight(seed, plant=plant)


def noisy_flight(seed, stops=(), **options):
    """All bytes of a flight; `stops` are times at which the state is only read."""
    pilot = Pilot(noise=0.002, jitter=0.03, seed=seed, **options).connect(demo=False)
    packets = []
    stops = sorted(stops)
    for k in range(280):
        pilot.time = round(0.02 * k, 6)
        while stops and stops[0] <= pilot.time:
            pilot.drone.advance(stops.pop(0))
        pilot.send(UP, Move(gaz=0.5 * math.sin(0.1 * k), roll=0.2))
    packets = pilot.sent
    return b"".join(packets)


@pytest.mark.parametrize("plant", ["kit", "thrust"])
def test_the_same_seed_gives_the_same_bytes(plant):
    first = undisturbed_flight(3, plant)
    assert first == noisy_flight(3, plant=plant)
    assert first != noisy_flight(4, plant=plant)


@settings(max_examples=4)
@given(st.lists(st.floats(0.0, 6.0), max_size=50), st.sampled_from(["real", "thrust"]))
def test_reading_the_state_does_not_change_the_flight(stops, plant):
    assert noisy_flight(1, stops, plant=plant) == undisturbed_flight(1, plant)


def test_jitter_delays_packets_and_never_reorders_them():
    pilot = Pilot(delay=0.1, jitter=0.05).connect(demo=False).fly()
    pilot.sent.clear()
    sent = {}
    for k in range(1, 200):
        sent[k] = pilot.time
        pilot.send(UP, Move(gaz=k / 200))
        pilot.wait(0.01)
    echoes = [parse_navdata(packet) for packet in pilot.sent]
    setpoints = [echo.climb_setpoint for echo in echoes]
    assert setpoints == sorted(setpoints)
    late = [
        echo.clock - sent[round(echo.climb_setpoint / 0.7 * 200)]
        for before, echo in pairwise(echoes)
        if echo.climb_setpoint != before.climb_setpoint
    ]
    assert min(late) >= 0.1 - 1e-6
    assert max(late) <= 0.155 + 1e-6  # Packets are 5 ms apart.
    assert max(late) - min(late) > 0.03


# --- plants ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["kit", "paper", "real"])
def test_a_linear_plant_is_stepped_exactly(name):
    plant = LINEAR_PLANTS[name]
    times = np.arange(1, 60) * 0.137
    motion = LinearMotion(plant)
    motion.settle(0, 0.0)
    motion.follow(0, 0.4)
    heights = [motion.at(round(1e6 * t))[0] for t in times]
    exact = plant.transfer_function().step_response(np.concatenate([[0.0], times]))
    assert np.allclose(heights, 0.4 * np.ravel(exact.outputs)[1:], rtol=0.0, atol=1e-13)


@pytest.mark.parametrize(
    ("name", "delay", "gain"), [("kit", 0.26, 2.4), ("paper", 0.36, 2.0), ("real", 0.34, 1.8)]
)
def test_a_loop_around_the_emulated_drone_equals_the_control_loop(name, delay, gain):
    """P control of the drone's height at 65 ms equals the exact simulation of the same loop."""
    sample, step = 0.065, 0.25
    pilot = Pilot(plant=name)
    configured(pilot, "control:control_vz_max", "1000")
    pilot.fly().wait(20.0, UP)
    start, begun = pilot.time, pilot.truth.height
    heights = []
    for k in range(150):
        pilot.time = round(start + k * sample, 6)
        height = pilot.truth.height
        heights.append(height - begun)
        error = gain * (begun + step - height)
        pilot.send(UP, Move(gaz=max(-1.0, min(1.0, error))))
    loop = dtm.ControlLoop(
        LINEAR_PLANTS[name], dtm.P(gain), delay=delay, sample_time=sample, limit=1.0
    )
    exact = loop.simulate(np.arange(150) * sample, step).outputs
    # Commands travel as single-precision numbers.
    assert np.allclose(heights, exact, rtol=0.0, atol=1e-6)


def test_thrust_plant_near_hover_is_two_equal_lags():
    thruster = Thruster()
    motion = ThrustMotion(thruster)
    motion.settle(0, 1.0)
    small = 1e-4
    motion.follow(0, small)
    times = np.arange(1, 100) * 0.01
    climbs = [motion.at(round(1e6 * t))[1] for t in times]
    rate = 0.5 / thruster.motor_lag
    assert thruster.speed_gain * 4.0 * thruster.motor_lag == pytest.approx(1.0)
    exact = small * (1.0 - (1.0 + rate * times) * np.exp(-rate * times))
    assert np.allclose(climbs, exact, rtol=0.0, atol=1e-4 * small)


def test_thrust_plant_follows_its_equations():
    thruster = Thruster()
    weight = thruster.mass * GRAVITY
    assert 4.0 * thruster.thrust_factor * thruster.hover_speed**2 == pytest.approx(weight)
    down, up = thruster.accelerations
    assert down == pytest.approx(-8.513, abs=0.01)
    assert up == pytest.approx(10.887, abs=0.01)
    # The setpoint is far beyond what the rotors give, so their limits set the acceleration.
    motion = ThrustMotion(thruster)
    motion.settle(0, 0.0)
    motion.follow(0, 50.0)
    early, late = motion.at(400_000)[1], motion.at(500_000)[1]
    assert (late - early) / 0.1 == pytest.approx(up, rel=1e-3)
    # Tilted, thrust lifts less: m z'' = T cos(roll) cos(pitch) - m g; the speed loop compensates.
    motion.settle(1_000_000, 5.0)
    motion.follow(1_000_000, 0.0)
    motion.tilt(1_000_000, math.cos(0.2))
    lost = GRAVITY * (1.0 / math.cos(0.2) - 1.0) / thruster.speed_gain
    assert motion.at(4_000_000)[1] == pytest.approx(-lost, rel=1e-3)


def test_thrust_plant_does_not_depend_on_when_it_is_read():
    seldom, often = (ThrustMotion(Thruster()) for _ in "ab")
    for motion in (seldom, often):
        motion.settle(0, 1.0)
        motion.follow(1234, 0.7)
    for time in range(1300, 900_000, 777):
        often.at(time)
    assert seldom.at(900_000) == often.at(900_000)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"plant": "kite"}, "give one of kit, paper, real, thrust"),
        ({"delay": -0.1}, "delay"),
        ({"jitter": float("nan")}, "jitter"),
        ({"delay": 101.0}, "from 0 to 100"),
        ({"downlink": 21.0}, "from 0 to 20"),
        ({"noise": 1e9}, "from 0 to 10"),
        ({"battery": 101.0}, "from 0 to 100"),
        ({"seed": -1}, "seed"),
        ({"navdata_port": 70000}, "from 0 to 65535"),
    ],
)
def test_invalid_options_are_refused_with_the_reason(given, message):
    with pytest.raises(ValueError, match=message):
        EmulatorOptions(**given)


@pytest.mark.parametrize("field", ["mass", "motor_lag"])
def test_a_thrust_plant_needs_positive_parameters(field):
    with pytest.raises(ValueError, match=field):
        Thruster(**{field: 0.0})
    with pytest.raises(ValueError, match="cannot hover"):
        Thruster(hover_speed=1.0)
