"""A MAVLink vehicle against a stand-in for ArduPilot and PX4, in virtual time."""

import asyncio
import math
import random
from types import SimpleNamespace

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from deadtime import FlightAbortedError, LinkError
from deadtime.links import Limits, now, run
from deadtime.links.mavlink import MAVLinkVehicle
from deadtime.links.mavlink.states import _heading
from pymavlink.dialects.v20 import ardupilotmega as d
from stand_in_autopilot import MODES, StandIn, told

ADDRESS = "udp:127.0.0.1:14550"
LIMITS = Limits(max_climb=1.0)
FIRMWARES = ["ardupilot", "px4"]


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_whole_flight(firmware):
    async def flight():
        async with StandIn(firmware) as vehicle:
            before = dict(vehicle.parameters)
            async with MAVLinkVehicle(ADDRESS, LIMITS) as link:
                assert link.autopilot == {"ardupilot": "ArduPilot", "px4": "PX4"}[firmware]
                assert not vehicle.armed
                changed = dict(vehicle.parameters)
                assert changed != before
                await link.take_off()
                state = await link.state()
                assert state.flying
                assert state.height == pytest.approx(vehicle.height, abs=0.03)
                assert state.height == pytest.approx(1.0, abs=0.15)
                await told(link, 0.3, 2.0)
                state = await link.state()
                assert state.climb == pytest.approx(0.3, abs=0.01)
                assert state.climb_setpoint == pytest.approx(0.3)
                assert state.height == pytest.approx(vehicle.height, abs=0.03)
                await link.land()
                assert vehicle.height == 0.0
                assert not vehicle.armed
                await link.take_off()  # and again over the same link
                await link.land()
                assert (await link.state()).landed
            assert vehicle.parameters == before
            return changed

    changed = run(flight())
    if firmware == "ardupilot":
        assert changed["GUID_TIMEOUT"] == 0.5
        assert changed["FS_GCS_ENABLE"] == 5
        # The margin, and what an old set point may climb, are above the largest height.
        assert changed["FENCE_ALT_MAX"] == pytest.approx(3.0 + 2.0 + 0.5)
        assert (changed["FENCE_TYPE"], changed["FENCE_ACTION"], changed["FENCE_ENABLE"]) == (
            1,
            2,
            1,
        )
        assert changed["ANGLE_MAX"] == pytest.approx(1500.0, rel=1e-6)
    else:
        assert (changed["COM_OF_LOSS_T"], changed["COM_OBL_RC_ACT"]) == (0.5, 5)
        assert (changed["NAV_DLL_ACT"], changed["GF_ACTION"]) == (3, 5)


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_the_limits_of_a_vehicle_are_only_made_stricter(firmware):
    strict = {
        "ardupilot": {"GUID_TIMEOUT": 0.2, "ANGLE_MAX": 1100.0},
        "px4": {"COM_OF_LOSS_T": 0.3},
    }

    async def connected():
        async with StandIn(firmware) as vehicle:
            vehicle.parameters.update(strict[firmware])
            if firmware == "ardupilot":
                vehicle.parameters |= {"FENCE_ENABLE": 1.0, "FENCE_ALT_MAX": 4.0}
            async with MAVLinkVehicle(ADDRESS, LIMITS):
                for name, value in strict[firmware].items():
                    assert vehicle.parameters[name] == value
                if firmware == "ardupilot":
                    assert vehicle.parameters["FENCE_ALT_MAX"] == 4.0
                    assert vehicle.parameters["FENCE_TYPE"] == 7.0

    run(connected())


@pytest.mark.parametrize(
    ("firmware", "fence", "message"),
    [
        ("ardupilot", {"FENCE_ALT_MAX": 3.2}, r"3\.2 m \(FENCE_ALT_MAX\).*3\.5 m.*max_height"),
        ("ardupilot", {"FENCE_RADIUS": 4.0}, r"4 m \(FENCE_RADIUS\).*max_distance"),
        ("ardupilot", {"FENCE_ALT_MIN": 0.5, "FENCE_TYPE": 15.0}, r"0\.5 m \(FENCE_ALT_MIN\)"),
        ("px4", {"GF_MAX_VER_DIST": 2.0}, r"2 m \(GF_MAX_VER_DIST\)"),
        ("px4", {"GF_MAX_HOR_DIST": 2.0}, r"2 m \(GF_MAX_HOR_DIST\)"),
    ],
)
def test_a_fence_of_the_vehicle_that_the_limits_reach_beyond_is_refused(firmware, fence, message):
    """It was kept without a word, flown into, and its landing taken for another station's."""

    async def connected():
        async with StandIn(firmware) as vehicle:
            if firmware == "ardupilot":
                vehicle.parameters["FENCE_ENABLE"] = 1.0
            vehicle.parameters |= fence
            before = dict(vehicle.parameters)
            with pytest.raises(LinkError, match=message):
                await MAVLinkVehicle(ADDRESS, LIMITS).connect()
            assert vehicle.parameters == before

    run(connected())


def test_commands_are_bounded_and_expire():
    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            with pytest.raises(LinkError, match="not in the air"):
                link.command(0.1)
            await link.take_off()
            assert link.command(7.0) == 1.0
            assert link.command(-7.0) == -1.0
            with pytest.raises(ValueError, match="finite"):
                link.command(float("nan"))
            assert link.command(0.4) == 0.4
            given = vehicle.time
            await asyncio.sleep(0.9)
            late = [speed for time, speed in vehicle.set_points if time > given + 0.31]
            assert late
            assert set(late) == {0.0}
            await asyncio.sleep(0.3)
            with pytest.raises(FlightAbortedError, match="no command was given for"):
                link.command(0.1)
            await asyncio.sleep(0.3)
            assert vehicle.mode == vehicle.landing
            await asyncio.sleep(4.0)
            assert not vehicle.armed

    run(flight())


def test_a_flight_over_tcp_and_what_follows_the_end_of_the_stream():
    async def flight():
        async with StandIn(tcp=("127.0.0.1", 5760)) as vehicle:
            link = MAVLinkVehicle("tcp:127.0.0.1:5760", LIMITS)
            await link.connect()
            await link.take_off()
            await told(link, 0.2, 1.0)
            assert (await link.state()).climb == pytest.approx(0.2, abs=0.01)
            vehicle.stream.close()
            with pytest.raises(LinkError, match="nothing has been received"):
                await told(link, 0.2, 3.0)
            with pytest.raises(LinkError, match="during the landing"):
                await link.close()
            assert not vehicle.armed

    run(flight())


def test_all_axes_are_commanded_within_their_limits():
    limits = Limits(max_climb=1.0, max_speed=1.0, max_yaw_rate=0.3)

    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, limits) as link:
            await link.take_off()
            sent = link.command_velocity(north=3.0, east=-4.0, up=0.2, turn=7.0)
            assert sent == pytest.approx((0.6, -0.8, 0.2, 0.3))
            with pytest.raises(ValueError, match="turn"):
                link.command_velocity(turn=float("inf"))
            before = await link.state()
            for _ in range(20):
                link.command_velocity(north=0.6, east=-0.8, turn=0.3)
                await asyncio.sleep(0.05)
            state = await link.state()
            assert state.north - before.north == pytest.approx(0.6, abs=0.05)
            assert state.east - before.east == pytest.approx(-0.8, abs=0.05)
            assert (state.north_speed, state.east_speed) == pytest.approx((0.6, -0.8))
            assert state.yaw_rate == pytest.approx(0.3)
            assert state.yaw == pytest.approx(0.3, abs=0.05)
            assert vehicle.turn == pytest.approx(0.3)
            link.hover()
            await asyncio.sleep(0.2)
            assert vehicle.along == (0.0, 0.0)

    run(flight())


def test_parameters_are_read_set_and_put_back():
    async def flight():
        async with StandIn() as vehicle:
            link = MAVLinkVehicle(ADDRESS, LIMITS)
            with pytest.raises(LinkError, match="not connected"):
                await link.parameter("ANGLE_MAX")
            vehicle.parameters["WIND"] = 2.5
            async with link:
                assert await link.parameter("WIND") == 2.5
                await link.set_parameter("WIND", 4.0)
                assert vehicle.parameters["WIND"] == 4.0
                with pytest.raises(LinkError, match="NONE"):
                    await link.parameter("NONE")
            assert vehicle.parameters["WIND"] == 2.5

    run(flight())


def test_a_ground_station_that_falls_silent_is_survived_by_the_vehicle_alone():
    async def flight():
        async with StandIn() as vehicle:
            link = MAVLinkVehicle(ADDRESS, LIMITS)
            await link.connect()
            await link.take_off()
            link.command(1.0)
            await asyncio.sleep(0.01)
            vehicle.drop = lambda message: message.get_srcSystem() == 255
            silent = vehicle.time
            await asyncio.sleep(0.45)
            assert vehicle.told == 1.0
            await asyncio.sleep(0.1)
            assert vehicle.told == 0.0
            while vehicle.mode != vehicle.landing:
                await asyncio.sleep(0.05)
            assert vehicle.time - silent < 2.0 + 1.0
            link._shut()

    run(flight())


def test_a_parameter_that_is_not_kept_is_refused_and_the_others_put_back():
    async def connected():
        async with StandIn() as vehicle:
            before = dict(vehicle.parameters)
            vehicle.drop = lambda m: m.get_type() == "PARAM_SET" and m.param_id == "FENCE_ACTION"
            with pytest.raises(LinkError, match="does not accept the value FENCE_ACTION = 2"):
                await MAVLinkVehicle(ADDRESS, LIMITS).connect()
            assert vehicle.parameters == before

    run(connected())


def test_nobody_there():
    with pytest.raises(LinkError, match="no heartbeat of a vehicle"):
        run(MAVLinkVehicle(ADDRESS, LIMITS).connect())
    with pytest.raises(LinkError, match="cannot be opened"):
        run(MAVLinkVehicle("tcp:127.0.0.1:5760", LIMITS).connect())


def test_the_reason_why_it_does_not_arm_is_told():
    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            task = asyncio.create_task(link.take_off())
            await asyncio.sleep(1.0)
            vehicle.ready = False  # it is ready by its report, and then refuses
            with pytest.raises(LinkError, match='does not arm; the vehicle says "PreArm: no pos'):
                await task
            assert vehicle.height == 0.0

    async def soon_ready():
        async with StandIn() as vehicle:
            vehicle._arm, arm = (
                (lambda value: 4 if vehicle.time < 30.0 else arm(value)),
                vehicle._arm,
            )
            async with MAVLinkVehicle(ADDRESS, LIMITS) as link:
                await link.take_off()

    run(soon_ready())


def test_a_lost_link_ends_the_flight():
    async def flight():
        async with StandIn() as vehicle:
            link = MAVLinkVehicle(ADDRESS, LIMITS)
            await link.connect()
            await link.take_off()
            await told(link, 0.1, 0.5)
            begin = now()
            vehicle.drop = lambda message: True
            with pytest.raises(LinkError, match="nothing has been received"):
                await told(link, 0.1, 5.0)
            assert now() - begin < 1.2
            with pytest.raises(LinkError, match="during the landing"):
                await link.close()
            # The failsafes remain in the vehicle, and have landed it.
            assert vehicle.parameters["FS_GCS_ENABLE"] == 5.0
            await asyncio.sleep(3.0)
            assert not vehicle.armed

    run(flight())


def test_loss_of_a_quarter_of_all_messages_is_overcome():
    async def flight():
        async with StandIn() as vehicle:
            lost = random.Random(1)
            vehicle.drop = lambda message: lost.random() < 0.25
            before = dict(vehicle.parameters)
            async with MAVLinkVehicle(ADDRESS, LIMITS) as link:
                await link.take_off()
                await told(link, 0.2, 3.0)
                state = await link.state()
                assert 1 <= state.missing <= 8
                assert state.climb == pytest.approx(0.2, abs=0.01)
            assert vehicle.parameters == before
            assert not vehicle.armed

    run(flight())


def test_the_round_trip_of_the_link_is_measured():
    """The stand-in answers at once, on a clock that is 20 s ahead."""

    async def connected():
        async with StandIn(), MAVLinkVehicle(ADDRESS, LIMITS) as link:
            await asyncio.sleep(2.0)
            return link.link_time, now()

    found, _ = run(connected())
    assert found.median == pytest.approx(0.0, abs=1e-9)
    assert found.offset == pytest.approx(20.0, abs=1e-6)
    assert found.answers > 15
    assert found.lost == 0


def test_a_signed_link_refuses_what_is_not_signed():
    key = bytes(range(32))

    async def flight(**options):
        async with StandIn(**options), MAVLinkVehicle(ADDRESS, LIMITS, key=key) as link:
            await link.take_off()

    run(flight(key=key))
    for options in ({}, {"key": bytes(32)}):
        with pytest.raises(LinkError, match="no heartbeat of a vehicle"):
            run(flight(**options))


def test_the_faults_of_a_vehicle_are_reported():
    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            vehicle.battery = 12
            await asyncio.sleep(1.0)
            with pytest.raises(LinkError, match="12 % of battery"):
                await link.take_off()
            vehicle.battery, vehicle.status = 80, 5
            await asyncio.sleep(1.0)
            with pytest.raises(LinkError, match="failsafe of its own is active"):
                await link.take_off()
            vehicle.status = None
            await asyncio.sleep(1.0)
            await link.take_off()
            vehicle.status = 6
            await asyncio.sleep(0.5)
            assert (await link.state()).emergency
            vehicle.status = None

    run(flight())


def test_a_listener_gets_every_state_and_its_error_is_raised():
    async def flight():
        async with StandIn(), MAVLinkVehicle(ADDRESS, LIMITS) as link:
            states = []
            link.listen(states.append)
            await asyncio.sleep(1.0)
            link.listen(None)
            assert len(states) == pytest.approx(50, abs=3)
            times = [state.vehicle_time for state in states]
            assert times == sorted(set(times))
            link.listen(lambda state: 1 / 0)
            await asyncio.sleep(0.1)
            with pytest.raises(LinkError, match="listener"):
                await link.state()

    run(flight())


def test_addresses_and_options_are_checked():
    for address in ("udp:", "udp:127.0.0.1", "ftp:127.0.0.1:80", "tcp:host:70000"):
        with pytest.raises(ValueError, match="Give udp:HOST:PORT"):
            MAVLinkVehicle(address)
    with pytest.raises(ValueError, match="take_off_height"):
        MAVLinkVehicle(ADDRESS, take_off_height=4.0)
    with pytest.raises(ValueError, match="system=0"):
        MAVLinkVehicle(ADDRESS, system=0)
    with pytest.raises(ValueError, match="key has 3 bytes"):
        MAVLinkVehicle(ADDRESS, key=b"key")


def test_a_flight_ends_on_the_ground_also_when_the_program_is_interrupted():
    async def flight():
        async with StandIn() as vehicle:

            async def interrupted():
                async with MAVLinkVehicle(ADDRESS, LIMITS) as link:
                    await link.take_off()
                    await told(link, 0.1, 20.0)

            task = asyncio.create_task(interrupted())
            while vehicle.height < 0.95:
                await asyncio.sleep(0.1)
            await asyncio.sleep(1.0)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            assert not vehicle.armed
            assert vehicle.parameters["FS_GCS_ENABLE"] == 0.0

    run(flight())


def test_modes_have_the_names_of_their_firmware():
    from deadtime.links.mavlink.autopilots import PX4, ArduPilot

    assert ArduPilot().mode_name(MODES["ardupilot"][1]) == "LAND"
    assert PX4().mode_name(MODES["px4"][1]) == "AUTO.LAND"
    assert PX4().mode_name(MODES["px4"][0]) == "OFFBOARD"


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_only_a_simulator_is_flown_where_one_is_asked_for(firmware):
    async def connected():
        async with StandIn(firmware) as vehicle:
            vehicle.parameters.pop("SIM_SPEEDUP", None)
            before = dict(vehicle.parameters)
            with pytest.raises(LinkError, match=r"is a simulator.*--i-have-a-safe-area"):
                async with MAVLinkVehicle(ADDRESS, LIMITS, simulated=True):
                    pass
            assert vehicle.parameters == before
            assert not any(
                command == d.MAV_CMD_COMPONENT_ARM_DISARM for command, _ in vehicle.commands
            )

    run(connected())


def test_a_simulator_is_one_by_its_parameter():
    async def connected():
        async with StandIn(), MAVLinkVehicle(ADDRESS, LIMITS, simulated=True) as link:
            return await link.parameter("SIM_SPEEDUP")

    assert run(connected()) == 1.0


def test_the_limits_of_a_commanded_rate_are_those_of_the_vehicle_s_parameters():
    async def asked():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            vehicle.parameters |= {"WPNAV_ACCEL": 250.0, "PSC_JERK_XY": 5.0}
            vehicle.parameters |= {"ATC_ACCEL_Y_MAX": 27000.0}
            return [await link.shaping(axis) for axis in link.axes]

    height, north, east, heading = run(asked())
    assert height is None  # this vehicle has no such parameters
    assert north == east == pytest.approx((2.5, 5.0))
    assert heading == (pytest.approx(4.712, abs=1e-3), None)


def test_a_heading_is_continued_to_the_time_of_the_position():
    attitude = SimpleNamespace(time_boot_ms=1000, yaw=3.13, yawspeed=0.5)
    assert _heading(attitude, 1.04) == pytest.approx(3.15 - 2.0 * math.pi)
    assert _heading(attitude, 9.0) == pytest.approx(3.18 - 2.0 * math.pi)  # not for ever
    assert _heading(attitude, 0.9) == 3.13


def loses_position(vehicle):
    """As without GPS: no more positions, and a failsafe that says so."""
    vehicle.ready = False
    vehicle.drop = lambda m: m.get_type() in ("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT")


def test_a_vehicle_without_a_position_is_seen_to_land():
    """It was said not to have landed after 60 s, 50 s after it had disarmed on the ground."""

    async def flight():
        async with StandIn() as vehicle:
            before = dict(vehicle.parameters)
            link = MAVLinkVehicle(ADDRESS, LIMITS)
            await link.connect()
            await link.take_off()
            await told(link, 0.1, 2.0)
            loses_position(vehicle)
            with pytest.raises(FlightAbortedError, match="lost its position estimate"):
                await told(link, 0.1, 2.0)
            begin = now()
            await link.close()
            assert now() - begin < 10.0
            assert not vehicle.armed
            assert vehicle.parameters == before

    run(flight())


def test_the_failsafe_of_the_position_estimate_is_named_however_a_flight_ends():
    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            await link.take_off()
            await told(link, 0.1, 2.0)
            loses_position(vehicle)
            await asyncio.sleep(0.3)
            vehicle.say("EKF Failsafe: changed to LAND Mode")
            vehicle.change_mode(vehicle.landing)
            raise FlightAbortedError("the newest message is 0.31 s old")

    with pytest.raises(FlightAbortedError, match=r"0\.31 s old") as ended:
        run(flight())
    assert (
        'position estimate (EKF_STATUS_REPORT). The vehicle says "EKF Failsafe'
        in (ended.value.__notes__[0])
    )
