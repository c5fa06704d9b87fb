"""Positions, attitudes and rates as set points: their limits, their frames, and the stand-in."""

import asyncio
import itertools
import math
import random
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from deadtime import LinkError
from deadtime.links import Limits, Motion, VehicleState, run
from deadtime.links.mavlink import MAVLinkVehicle
from deadtime.links.mavlink.codec import Codec
from deadtime.links.mavlink.point_messages import message_of, quaternion
from deadtime.links.mavlink.points import (
    Attitude,
    BodyRates,
    Place,
    attitude_within,
    place_within,
    rates_within,
)
from deadtime.links.mavlink.states import _heading
from pymavlink.dialects.v20 import ardupilotmega as d
from scipy.spatial.transform import Rotation
from stand_in_autopilot import StandIn

LIMITS = Limits(max_climb=1.0)
ADDRESS = "udp:127.0.0.1:14550"
FIRMWARES = ["ardupilot", "px4"]

ORIGIN = VehicleState(0.0, 1.0, True, False, 1, north=10.0, east=-20.0)


def state(roll=0.0, pitch=0.0):
    return VehicleState(0.0, 1.0, True, False, 1, roll=roll, pitch=pitch)


def drawn(count):
    numbers = random.Random(1)
    special = [0.0, -0.0, 1e-300, 1e308, -1e308, 0.1, -0.1]
    for _ in range(count):
        yield [numbers.choice([*special, numbers.gauss(0.0, 3.0)]) for _ in range(6)]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_state_that_is_not_finite_becomes_no_set_point(value):
    """A position at NaN was sent, and the largest roll rate for a roll of NaN."""
    for place in ({"north": value}, {"east": value}):
        with pytest.raises(ValueError, match="of the vehicle"):
            place_within(Place(1.0, 2.0, 1.0, 0.0), replace(ORIGIN, **place), LIMITS)
    for tilt in ({"roll": value}, {"pitch": value}):
        with pytest.raises(ValueError, match="of the vehicle"):
            rates_within(BodyRates(0.1, 0.1, 0.0, 0.4), state(**tilt), LIMITS)
    attitude = SimpleNamespace(time_boot_ms=1000, yaw=value, yawspeed=0.1)
    assert _heading(attitude, 1.04) is None
    assert _heading(SimpleNamespace(time_boot_ms=1000, yaw=0.1, yawspeed=value), 1.04) is None


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_messages_that_are_not_finite_neither_move_the_vehicle_nor_break_the_link(value, count):
    """A heading of infinity was a math domain error in the listener, and ended the link."""

    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            for kind in ("position", "rates"):
                await link.allow(kind)
            await link.take_off()
            before = await link.state()
            ms = round(1e3 * vehicle.time) + 5
            for number in range(count):
                for place in range(6):
                    numbers = [0.0] * 6
                    numbers[place] = value
                    vehicle.send(d.MAVLink_local_position_ned_message(ms + number, *numbers))
                    vehicle.send(d.MAVLink_attitude_message(ms + number, *numbers))
            await asyncio.sleep(0.0)
            after = await link.state()
            assert (after.north, after.height) == (before.north, before.height)
            place = link.command_position(0.0, 0.0, 1.0, heading=0.0)
            assert all(map(math.isfinite, place))
            await asyncio.sleep(0.1)
            link.command_rates(0.0, 0.0, 0.0, 0.5)
            assert all(
                math.isfinite(number)
                for sent in vehicle.places
                for number in (sent.x, sent.y, sent.z, sent.yaw)
            )

    run(flight())


def test_any_finite_numbers_become_what_is_allowed():
    for a, b, c, e, roll, pitch in drawn(3000):
        place = place_within(Place(a, b, c, e), ORIGIN, LIMITS)
        away = math.hypot(place.north - 10.0, place.east + 20.0)
        assert away <= LIMITS.max_distance * (1 + 1e-12)
        assert LIMITS.min_height <= place.height <= LIMITS.max_height
        attitude = attitude_within(Attitude(a, b, c, e), LIMITS)
        assert math.hypot(attitude.roll, attitude.pitch) <= LIMITS.max_angle * (1 + 1e-12)
        rates = rates_within(BodyRates(a, b, c, e), state(roll, pitch), LIMITS)
        assert max(abs(rates.roll), abs(rates.pitch)) <= LIMITS.max_body_rate
        assert abs(rates.turn) <= LIMITS.max_yaw_rate
        for one in (attitude, rates):
            assert LIMITS.min_thrust <= one.thrust <= LIMITS.max_thrust
        for one in (place.heading, attitude.heading):
            assert abs(one) <= math.pi
        assert all(map(math.isfinite, (*place, *attitude, *rates)))


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(4))
def test_numbers_that_are_not_finite_are_refused(wrong, place):
    numbers = [0.1] * 4
    numbers[place] = wrong
    with pytest.raises(ValueError, match="finite"):
        place_within(Place(*numbers), ORIGIN, LIMITS)
    with pytest.raises(ValueError, match="finite"):
        attitude_within(Attitude(*numbers), LIMITS)
    with pytest.raises(ValueError, match="finite"):
        rates_within(BodyRates(*numbers), state(), LIMITS)


def test_what_is_allowed_is_not_changed():
    place = Place(11.0, -21.0, 2.0, 1.0)
    assert place_within(place, ORIGIN, LIMITS) == pytest.approx(place)
    attitude = Attitude(0.1, -0.1, 1.0, 0.5)
    assert attitude_within(attitude, LIMITS) == pytest.approx(attitude)
    rates = BodyRates(0.2, -0.2, 0.3, 0.5)
    assert rates_within(rates, state(), LIMITS) == pytest.approx(rates)


def test_the_tilt_of_a_longer_attitude_keeps_its_direction():
    found = attitude_within(Attitude(0.6, -0.8, 0.0, 0.5), LIMITS)
    assert (found.roll, found.pitch) == pytest.approx(
        (0.6 * LIMITS.max_angle, -0.8 * LIMITS.max_angle)
    )


def test_rates_do_not_tilt_beyond_the_limit_while_they_are_valid():
    most, age = LIMITS.max_angle, LIMITS.command_age
    angles, rates = np.linspace(-most, most, 9), np.linspace(-5.0, 5.0, 11)
    for roll, pitch, along, up in itertools.product(angles, angles, rates, rates):
        found = rates_within(BodyRates(along, up, 0.0, 0.5), state(roll, pitch), LIMITS)
        tilt = math.hypot(roll + age * found.roll, pitch + age * found.pitch)
        # One beyond is brought back.
        assert tilt <= max(most, math.hypot(roll, pitch) - 1e-3) * (1 + 1e-12)
    found = rates_within(BodyRates(0.0, -1.0, 0.0, 0.5), state(0.0, -most - 0.1), LIMITS)
    assert (found.roll, found.pitch) == pytest.approx((0.0, 0.1 / age))


def read(point, ground=-2.0):
    """What another MAVLink program reads of a set point."""
    frame = Codec(255, 190).encode(message_of(point, (1, 1), 5.0, ground))
    (message,) = d.MAVLink(None).parse_buffer(frame)
    assert (message.target_system, message.target_component, message.time_boot_ms) == (1, 1, 5000)
    return message


def ignored(message, prefix):
    """The fields that the mask says are not followed."""
    bits = {
        entry.name.removeprefix(prefix).removesuffix("_IGNORE").lower(): value
        for value, entry in d.enums[prefix.removesuffix("_")].items()
        if entry.name.endswith("_IGNORE")
    }
    return {name for name, bit in bits.items() if message.type_mask & bit}


def test_positions_and_velocities_as_others_read_them():
    message = read(Place(1.0, 2.0, 3.0, 0.5))
    assert message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    assert message.coordinate_frame == d.MAV_FRAME_LOCAL_NED
    assert (message.x, message.y, message.z, message.yaw) == (1.0, 2.0, -5.0, 0.5)
    told = {"vx", "vy", "vz", "ax", "ay", "az", "yaw_rate"}
    assert ignored(message, "POSITION_TARGET_TYPEMASK_") == told
    message = read(Motion(0.5, 0.25, 0.125, None))
    assert (message.vx, message.vy, message.vz) == (0.5, 0.25, -0.125)
    told = {"x", "y", "z", "ax", "ay", "az", "yaw", "yaw_rate"}
    assert ignored(message, "POSITION_TARGET_TYPEMASK_") == told
    message = read(Motion(turn=0.5))
    assert message.yaw_rate == 0.5
    assert ignored(message, "POSITION_TARGET_TYPEMASK_") == told - {"yaw_rate"}


def test_attitudes_and_rates_as_others_read_them():
    message = read(Attitude(0.1, -0.2, 2.0, 0.375))
    assert message.get_type() == "SET_ATTITUDE_TARGET"
    names = {"body_roll_rate", "body_pitch_rate", "body_yaw_rate"}
    assert ignored(message, "ATTITUDE_TARGET_TYPEMASK_") == names
    assert message.thrust == 0.375
    w, x, y, z = message.q
    turned = Rotation.from_quat([x, y, z, w]).as_euler("ZYX")
    assert turned == pytest.approx([2.0, -0.2, 0.1], abs=1e-6)
    message = read(BodyRates(0.25, -0.5, 0.125, 0.5))
    assert ignored(message, "ATTITUDE_TARGET_TYPEMASK_") == {"attitude"}
    rates = message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate
    assert (*rates, message.thrust) == (0.25, -0.5, 0.125, 0.5)


def test_a_rotation_has_unit_length():
    for roll, pitch, heading, *_ in drawn(200):
        assert np.linalg.norm(quaternion(roll, pitch, heading)) == pytest.approx(1.0)


async def told(command, seconds):
    for _ in range(round(seconds / 0.065)):
        command()
        await asyncio.sleep(0.065)


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_flight_to_a_place(firmware):
    async def flight():
        async with StandIn(firmware) as vehicle:
            before = dict(vehicle.parameters)
            async with MAVLinkVehicle(ADDRESS, LIMITS) as link:
                await link.allow("position")
                held = dict(vehicle.parameters)
                with pytest.raises(LinkError, match="take off before"):
                    link.command_position(0.0, 0.0, 1.0)
                await link.take_off()
                sent = link.command_position(1.0, -2.0, 2.0, heading=0.5)
                assert sent == Place(1.0, -2.0, 2.0, 0.5)
                await told(lambda: link.command_position(1.0, -2.0, 2.0, heading=0.5), 6.0)
                state = await link.state()
                where = state.north, state.east, state.height, state.yaw
                assert where == pytest.approx((1.0, -2.0, 2.0, 0.5), abs=0.05)
                # The present heading, and no further than what is allowed.
                assert link.command_position(0.0, -9.0, 9.0) == pytest.approx((0, -5, 3, 0.5))
                # An old position is replaced by hovering, not repeated.
                vehicle.places.clear()
                vehicle.set_points.clear()
                await asyncio.sleep(0.9)
                assert 1 <= len(vehicle.places) <= 3
                assert {speed for _, speed in vehicle.set_points} == {0.0}
                link.hover()
                await link.land()
            assert vehicle.parameters == before
            return held

    held = run(flight())
    if firmware == "ardupilot":
        speeds = [held[name] for name in ("WPNAV_SPEED", "WPNAV_SPEED_UP", "WPNAV_SPEED_DN")]
        assert speeds == [50.0, 100.0, 8.0]  # the last was stricter
        assert held["GUID_OPTIONS"] == 2.0
    else:
        assert held["MPC_XY_VEL_MAX"] == 0.5
        assert (held["MPC_Z_VEL_MAX_UP"], held["MPC_Z_VEL_MAX_DN"]) == (1.0, 1.0)


def test_without_a_known_heading_one_has_to_be_given():
    async def flight():
        async with StandIn() as vehicle:
            vehicle.drop = lambda message: message.get_type() == "ATTITUDE"
            async with MAVLinkVehicle(ADDRESS, LIMITS) as link:
                await link.allow("position")
                await link.take_off()
                assert (await link.state()).yaw is None
                with pytest.raises(LinkError, match="no heading: give a heading"):
                    link.command_position(0.0, 0.0, 1.0)
                assert link.command_position(0.0, 0.0, 1.0, heading=0.2).heading == 0.2

    run(flight())


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_flight_by_attitudes_and_by_rates(firmware):
    async def flight():
        async with StandIn(firmware) as vehicle:
            before = dict(vehicle.parameters)
            async with MAVLinkVehicle(ADDRESS, LIMITS) as link:
                await link.take_off()
                with pytest.raises(LinkError, match=r"allow\('attitude'\)"):
                    link.command_attitude(0.0, 0.0, 0.5)
                with pytest.raises(LinkError, match=r"allow\('rates'\)"):
                    link.command_rates(0.0, 0.0, 0.0, 0.5)
                await link.allow("attitude")
                await link.allow("rates")
                if firmware == "ardupilot":
                    assert vehicle.parameters["GUID_OPTIONS"] == 10.0  # with what was set
                await told(lambda: link.command_attitude(0.1, -0.05, 0.6, heading=0.3), 2.0)
                last = vehicle.attitudes[-1]
                assert last.type_mask == 0x07
                assert last.q == pytest.approx(quaternion(0.1, -0.05, 0.3), abs=1e-7)
                assert vehicle.climb == pytest.approx(0.1, abs=0.01)
                await told(lambda: link.command_rates(0.2, 0.0, 0.1, 0.45), 1.0)
                assert vehicle.attitudes[-1].type_mask == 0x80
                assert vehicle.climb == pytest.approx(-0.05, abs=0.02)
                for wrong in (math.nan, math.inf):
                    with pytest.raises(ValueError, match="finite"):
                        link.command_attitude(0.0, 0.0, wrong)
                    with pytest.raises(ValueError, match="finite"):
                        link.command_rates(wrong, 0.0, 0.0, 0.5)
                vehicle.attitudes.clear()
                await asyncio.sleep(0.9)
                assert 1 <= len(vehicle.attitudes) <= 3
                assert vehicle.told == 0.0
                link.hover()
            assert vehicle.parameters == before

    run(flight())


def test_kinds_of_set_points_have_names():
    async def flight():
        async with StandIn(), MAVLinkVehicle(ADDRESS, LIMITS) as link:
            with pytest.raises(
                ValueError,
                match="'speed' is not a kind of set point: give one of position, attitude, rates",
            ):
                await link.allow("speed")

    run(flight())


def test_a_vehicle_that_does_not_know_a_setting_is_refused():
    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            del vehicle.parameters["GUID_OPTIONS"]
            with pytest.raises(LinkError, match="does not report its parameter GUID_OPTIONS"):
                await link.allow("attitude")
            await link.take_off()
            with pytest.raises(LinkError, match="are not allowed yet"):
                link.command_attitude(0.0, 0.0, 0.5)

    run(flight())


def test_limits_of_thrust_are_shares_the_least_first():
    for least, most in ((0.5, 0.4), (0.5, 0.5), (0.5, 1.1)):
        with pytest.raises(ValueError, match="the smaller one first"):
            Limits(min_thrust=least, max_thrust=most)
