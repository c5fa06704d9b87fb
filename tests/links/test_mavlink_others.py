"""Pilots, other ground stations and other vehicles on the link, in virtual time."""

import asyncio

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from deadtime import FlightAbortedError, LinkError
from deadtime.links import Limits, run
from deadtime.links.mavlink import MAVLinkVehicle
from deadtime.links.mavlink.addresses import LinkAddress
from deadtime.links.mavlink.connection import Connection
from pymavlink.dialects.v20 import ardupilotmega as d
from stand_in_autopilot import StandIn, told

ADDRESS = "udp:127.0.0.1:14550"
LIMITS = Limits(max_climb=1.0)
FIRMWARES = ["ardupilot", "px4"]


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_vehicle_that_is_armed_is_not_taken_over(firmware):
    async def armed_before():
        async with StandIn(firmware, armed=True) as vehicle:
            with pytest.raises(LinkError, match="armed already"):
                await MAVLinkVehicle(ADDRESS, LIMITS).connect()
            assert not vehicle.commands
            assert vehicle.armed

    async def armed_later():
        async with StandIn(firmware) as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            vehicle.armed = True
            await asyncio.sleep(0.5)
            with pytest.raises(LinkError, match="armed already"):
                await link.take_off()
            assert d.MAV_CMD_COMPONENT_ARM_DISARM not in [number for number, _ in vehicle.commands]

    run(armed_before())
    run(armed_later())


def test_what_somebody_else_disarmed_is_not_armed_again():
    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            vehicle.armed = True
            await asyncio.sleep(1.5)
            vehicle.armed = False
            await asyncio.sleep(0.5)
            with pytest.raises(LinkError, match="disarmed, but not by this link"):
                await link.take_off()
            assert not vehicle.armed

    run(flight())


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize("mode", ["landing", "other"])
def test_another_ground_station_takes_over(firmware, mode):
    """It is obeyed at once: no further set point, no landing command of ours.

    The parameters go back on the ground: in the air its failsafes stay.
    """

    async def flight():
        async with StandIn(firmware) as vehicle:
            before = dict(vehicle.parameters)
            link = MAVLinkVehicle(ADDRESS, LIMITS)
            await link.connect()
            strict = dict(vehicle.parameters)
            await link.take_off()
            await told(link, 0.2, 1.0)
            station = d.MAVLink(None, 254, 190)
            hello = d.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(station)
            vehicle._transport.sendto(hello, vehicle.ground)
            vehicle.change_mode(getattr(vehicle, mode))
            changed = vehicle.time
            del vehicle.commands[:]
            with pytest.raises(FlightAbortedError, match="system 254, component 190") as caught:
                await told(link, 0.2, 3.0)
            assert "no set points are sent any more" in str(caught.value)
            assert vehicle.time - changed < 0.4
            last = vehicle.set_points[-1][0]
            if mode == "landing":
                await link.close()
                assert vehicle.height == 0.0
            else:
                with pytest.raises(LinkError, match="was not commanded to land") as ended:
                    await link.close()
                assert vehicle.mode == vehicle.other
                assert vehicle.armed
                changed = dict(strict.items() - before.items())
                assert all(
                    f"{name} = {before[name]:g}" in ended.value.__notes__[0] for name in changed
                )
            assert vehicle.set_points[-1][0] == last
            assert not vehicle.commands
            assert vehicle.parameters == (before if mode == "landing" else strict)

    run(flight())


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_pilot_who_interrupts_the_take_off_is_obeyed(firmware):
    async def flight():
        async with StandIn(firmware) as vehicle:
            link = MAVLinkVehicle(ADDRESS, LIMITS)
            await link.connect()
            rising = asyncio.create_task(link.take_off())
            while vehicle.height < 0.3:
                await asyncio.sleep(0.05)
            vehicle.change_mode(vehicle.other)
            del vehicle.commands[:]
            with pytest.raises(FlightAbortedError, match="not commanded from here"):
                await rising
            with pytest.raises(LinkError, match="not commanded to land"):
                await link.close()
            assert vehicle.mode == vehicle.other
            assert not vehicle.commands

    run(flight())


def test_a_program_that_ends_without_closing_lands_the_vehicle():
    async def program():
        link = MAVLinkVehicle(ADDRESS, LIMITS)
        await link.connect()
        await link.take_off()
        link.command(0.1)

    async def flight():
        async with StandIn() as vehicle:
            before = set(asyncio.all_tasks())
            await program()
            for task in set(asyncio.all_tasks()) - before:  # as `asyncio.run` does at its end
                task.cancel()
            await asyncio.sleep(0.3)
            assert vehicle.mode == vehicle.landing
            await asyncio.sleep(5.0)
            assert not vehicle.armed

    run(flight())


def test_a_pilot_who_interrupts_the_landing_is_obeyed():
    async def flight():
        async with StandIn() as vehicle:
            link = MAVLinkVehicle(ADDRESS, LIMITS)
            await link.connect()
            await link.take_off()
            landing = asyncio.create_task(link.land())
            await asyncio.sleep(0.8)
            assert vehicle.mode == vehicle.landing
            vehicle.change_mode(vehicle.other)
            with pytest.raises(LinkError, match="went to LOITER"):
                await landing
            await asyncio.sleep(1.0)
            assert vehicle.mode == vehicle.other
            link._shut()
            await asyncio.sleep(0.1)
            assert vehicle.mode == vehicle.other

    run(flight())


def test_others_on_the_link_are_ignored_and_named():
    """Another component of the vehicle, another vehicle, and a datagram from another address."""

    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS, vehicle=1) as link:
            other = d.MAVLink(None, 7, 1)
            camera = d.MAVLink(None, 1, 100)
            away = d.MAVLink_local_position_ned_message(10**9, 0, 0, -500, 0, 0, 0)
            armed = d.MAVLink_heartbeat_message(2, 3, 128, 4, 4, 3)
            for message in (away, armed):
                vehicle._transport.sendto(message.pack(other), vehicle.ground)
                vehicle._transport.sendto(message.pack(camera), vehicle.ground)
            async with StandIn() as elsewhere:
                elsewhere.send(away)
                await asyncio.sleep(0.1)
            state = await link.state()
            assert state.height == 0.0
            assert state.landed
            assert link.foreign == [
                "another vehicle, system 7, component 1 (2 frames)",
                "another component, system 1, component 100 (2 frames)",
            ]
            assert link._link.senders.elsewhere >= 1

    run(flight())


def test_of_several_vehicles_one_has_to_be_named():
    async def connected(**options):
        async with StandIn() as vehicle:
            other = d.MAVLink(None, 7, 1)
            hello = d.MAVLink_heartbeat_message(2, 3, 0, 4, 3, 3).pack(other)
            task = asyncio.create_task(MAVLinkVehicle(ADDRESS, LIMITS, **options).connect())
            await asyncio.sleep(0.05)
            vehicle._transport.sendto(hello, vehicle.ground)
            await task

    with pytest.raises(LinkError, match="several vehicles"):
        run(connected())


def test_a_vehicle_that_follows_another_station_is_refused():
    async def connected():
        async with StandIn() as vehicle:
            vehicle.parameters["SYSID_MYGCS"] = 200.0
            before = dict(vehicle.parameters)
            with pytest.raises(LinkError, match="system 200"):
                await MAVLinkVehicle(ADDRESS, LIMITS).connect()
            assert vehicle.parameters == before

    run(connected())


def test_a_heartbeat_that_was_overtaken_on_the_way_tells_nothing():
    """The mode of before a landing, 60 ms late: nobody went back to it."""
    vehicle = d.MAVLink(None, srcSystem=1, srcComponent=1)

    def heartbeat(number, mode):
        vehicle.seq = number % 256
        sent = d.MAVLink_heartbeat_message(2, 3, 129, mode, 4, 3)
        sent.pack(vehicle)
        return sent

    connection = Connection([LinkAddress.of(ADDRESS)], 255, 190)
    seen = []
    connection.take = lambda message, time: seen.append(message.custom_mode)
    carrier = connection.carriers.current
    # Numbers begin anew after 255. A second later they may have done so any number of times.
    for number, mode, time in [
        (250, 4, 0.0),
        (258, 9, 1.0),
        (254, 4, 1.06),
        (258, 9, 1.07),
        (200, 4, 2.0),
    ]:
        connection._receive(carrier, heartbeat(number, mode), time)
    assert seen == [4, 9, 9, 4]


def other_station(vehicle):
    """Another ground station, system 254, on the same link and on one of its own."""
    station = d.MAVLink(None, 254, 190)
    hello = d.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(station)
    vehicle._transport.sendto(hello, vehicle.ground)
    return station


def test_set_points_of_another_station_are_seen_and_named():
    """It sent 0.9 m/s in between ours, in the same mode, and nobody noticed."""

    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            await link.take_off()
            await told(link, 0.1, 3.0)  # ours alone are no reason
            await told(link, -0.1, 1.0)
            other_station(vehicle)

            async def meddle():
                while True:
                    vehicle.told = 0.9
                    await asyncio.sleep(0.1)

            task = asyncio.create_task(meddle())
            with pytest.raises(FlightAbortedError, match=r"0\.9 m/s.*system 254"):
                await told(link, 0.1, 3.0)
            task.cancel()
            await asyncio.sleep(0.2)
            assert vehicle.mode == vehicle.landing

    run(flight())


def test_a_few_forged_echoes_are_no_set_points_of_another_station():
    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            await link.take_off()
            await told(link, 0.1, 3.0)
            for _ in range(3):
                forged = [0.0] * 11
                forged[5] = -0.9
                vehicle.send(d.MAVLink_position_target_local_ned_message(10**6, 1, 0xDC7, *forged))
            await told(link, 0.1, 2.0)

    run(flight())


def test_a_failsafe_that_another_station_switches_off_ends_the_flight():
    """The vehicle announces each change of a parameter to everybody, and nobody listened."""

    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            await link.take_off()
            await told(link, 0.1, 1.0)
            other_station(vehicle)
            vehicle.parameters["FS_GCS_ENABLE"] = 0.0
            vehicle._send_parameter("FS_GCS_ENABLE")
            with pytest.raises(
                FlightAbortedError, match=r"FS_GCS_ENABLE was changed from 5 to 0.*system 254"
            ):
                await told(link, 0.1, 2.0)
            await link.land()
            assert not vehicle.armed
            with pytest.raises(LinkError, match="FS_GCS_ENABLE was changed"):
                await link.take_off()

    run(flight())


@pytest.mark.parametrize("count", [1, 3])
def test_a_forged_parameter_ends_no_flight(count):
    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            await link.take_off()
            await told(link, 0.1, 1.0)
            for _ in range(count):
                vehicle.send(d.MAVLink_param_value_message(b"FS_GCS_ENABLE", 0.0, 9, 1, 0))
            await told(link, 0.1, 2.0)

    run(flight())


def test_what_a_vehicle_says_is_printable():
    """ESC and BEL of a STATUSTEXT reached the terminal."""

    async def flight():
        async with StandIn() as vehicle, MAVLinkVehicle(ADDRESS, LIMITS) as link:
            await link.take_off()
            vehicle.say("a\x1b[2J\x07\x9b31mb")
            vehicle.change_mode(5)
            with pytest.raises(FlightAbortedError) as ended:
                await told(link, 0.1, 2.0)
            assert str(ended.value).isprintable()
            assert r"a\x1b[2J\x07" in str(ended.value)
            vehicle.change_mode(vehicle.landing)

    run(flight())
