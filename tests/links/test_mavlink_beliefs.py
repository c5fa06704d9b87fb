"""Forged, late and repeated messages of a vehicle: none decides alone, and later ones revise."""

import asyncio

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from deadtime import LinkError
from deadtime.links import Limits, run
from deadtime.links.mavlink import MAVLinkVehicle
from deadtime.links.mavlink.addresses import LinkAddress
from deadtime.links.mavlink.authority import Authority
from deadtime.links.mavlink.autopilots import ArduPilot
from deadtime.links.mavlink.connection import Connection
from deadtime.links.mavlink.states import StateReader
from pymavlink.dialects.v20 import ardupilotmega as d
from stand_in_autopilot import StandIn, told

ADDRESS = "udp:127.0.0.1:14550"
LIMITS = Limits(max_climb=1.0)

#: Heartbeats in GUIDED: armed, and not.
ARMED, DISARMED = 209, 81


def heartbeat(base_mode, mode=4, status=4):
    return d.MAVLink_heartbeat_message(2, 3, base_mode, mode, status, 3)


def judged(base_modes):
    """An authority over a flight in GUIDED, after heartbeats 0.2 s apart."""
    reader, authority, vehicle = StateReader(), Authority("it"), d.MAVLink(None, 1, 1)
    connection = Connection([LinkAddress.of(ADDRESS)], 255, 190)
    authority.armed_at = 0.0
    authority.fly(4)
    for number, base_mode in enumerate(base_modes):
        message = heartbeat(base_mode)
        message.pack(vehicle)
        vehicle.seq = (vehicle.seq + 1) % 256
        reader.take(message, 0.2 * number)
        authority.heard(reader, ArduPilot(), connection, 0.2 * number)
    return authority


@pytest.mark.parametrize("forged", [0, 1, 2, 3])
def test_true_heartbeats_revise_forged_ones(forged):
    """One heartbeat without the armed bit made the link abandon a flying vehicle for good."""
    authority = judged([ARMED] * 10 + [DISARMED] * forged + [ARMED] * 50)
    assert authority.holds
    assert authority.disarmed is None


def test_one_heartbeat_decides_nothing():
    assert judged([ARMED] * 10 + [DISARMED]).lost is None
    assert "disarmed, but not by this link" in judged([ARMED] * 10 + [DISARMED] * 2).lost


def test_what_many_heartbeats_agree_on_is_final():
    assert judged([ARMED] * 10 + [DISARMED] * 6 + [ARMED] * 50).is_sure


async def in_flight(vehicle):
    link = MAVLinkVehicle(ADDRESS, LIMITS)
    await link.connect()
    await link.take_off()
    await told(link, 0.1, 0.5)
    return link


async def forge(vehicle, message, count):
    for _ in range(count):
        vehicle.send(message)
        await asyncio.sleep(0.01)


def test_a_flight_goes_on_after_a_heartbeat_of_another_vehicle_with_the_same_id():
    """The flight ended 0.7 s later, without a landing, its failsafes off in the air."""

    async def flight():
        async with StandIn() as vehicle:
            before = dict(vehicle.parameters)
            link = await in_flight(vehicle)
            strict = dict(vehicle.parameters)
            for base_mode, mode in ((DISARMED, 4), (ARMED, 17), (DISARMED, 9)):
                await forge(vehicle, heartbeat(base_mode, mode), 1)
                await told(link, 0.05, 1.0)
                assert vehicle.parameters == strict
            await link.close()
            assert not vehicle.armed
            assert vehicle.parameters == before

    run(flight())


@pytest.mark.parametrize(("base_mode", "mode"), [(DISARMED, 4), (ARMED, 17)])
def test_what_forged_heartbeats_end_is_landed_and_its_failsafes_stay_until_then(base_mode, mode):
    """Three in a row are believed for a moment: the flight is given up, and landed."""

    async def flight():
        async with StandIn() as vehicle:
            before = dict(vehicle.parameters)
            link = await in_flight(vehicle)
            strict = dict(vehicle.parameters)
            await forge(vehicle, heartbeat(base_mode, mode), 3)
            with pytest.raises(LinkError):
                await told(link, 0.1, 1.0)
            closing = asyncio.create_task(link.close())
            while vehicle.armed:
                assert vehicle.parameters == strict
                await asyncio.sleep(0.05)
            await closing
            assert vehicle.height == 0.0
            assert vehicle.parameters == before

    run(flight())


def test_a_flight_that_was_given_up_is_landed_without_being_closed():
    async def flight():
        async with StandIn() as vehicle:
            link = await in_flight(vehicle)
            await forge(vehicle, heartbeat(DISARMED), 3)
            await asyncio.sleep(8.0)
            assert not vehicle.armed
            await link.close()

    run(flight())


def test_a_forged_state_of_landing_neither_moves_the_ground_nor_ends_the_landing():
    """Heights counted from where the vehicle flew, after one EXTENDED_SYS_STATE "on ground"."""

    async def flight():
        async with StandIn() as vehicle:
            link = await in_flight(vehicle)
            height = (await link.state()).height
            await forge(vehicle, d.MAVLink_extended_sys_state_message(0, 1), 3)
            await asyncio.sleep(0.3)
            assert (await link.state()).height == pytest.approx(height, abs=0.1)
            landing = asyncio.create_task(link.land())
            await asyncio.sleep(0.1)
            await forge(vehicle, d.MAVLink_extended_sys_state_message(0, 1), 3)
            await forge(vehicle, heartbeat(DISARMED), 3)
            await landing
            assert vehicle.height == 0.0
            await link.close()

    run(flight())


def test_a_vehicle_in_the_air_with_another_pilot_keeps_its_failsafes_until_it_is_down():
    """They went back, off, while it hovered in BRAKE."""

    async def flight():
        async with StandIn() as vehicle:
            before = dict(vehicle.parameters)
            link = await in_flight(vehicle)
            strict = dict(vehicle.parameters)
            vehicle.change_mode(17)
            with pytest.raises(LinkError, match="went to BRAKE"):
                await told(link, 0.1, 2.0)
            await asyncio.sleep(1.0)
            with pytest.raises(LinkError, match="was not commanded to land") as ended:
                await link.close()
            assert vehicle.parameters == strict
            assert "FS_GCS_ENABLE = 0" in "".join(ended.value.__notes__)
            assert before != strict

    run(flight())


def test_an_arming_whose_answer_is_lost_ends_on_the_ground():
    """It stayed armed on the ground: the link did not know that it had armed it."""

    async def flight():
        async with StandIn() as vehicle:
            async with MAVLinkVehicle(ADDRESS, LIMITS) as link:
                vehicle.drop = lambda m: m.get_type() == "COMMAND_ACK" and m.command == 400
                with pytest.raises(LinkError, match="does not acknowledge"):
                    await link.take_off()
            assert not vehicle.armed

    run(flight())


def test_an_arming_that_was_answered_wrongly_ends_on_the_ground():
    """A forged refusal: whoever armed it, it does not stay armed with a wish to fly."""

    async def flight():
        async with StandIn() as vehicle:
            arm = vehicle._arm
            vehicle._arm = lambda value: 4 if arm(value) == 0 and value else 0
            async with MAVLinkVehicle(ADDRESS, LIMITS) as link:
                with pytest.raises(LinkError, match="armed already"):
                    await link.take_off()
                assert not vehicle.armed

    run(flight())


def test_a_message_that_comes_a_second_late_is_no_gap_of_82():
    """Sequence numbers begin anew after 255: an old one seemed to be far ahead."""
    reader, vehicle = StateReader(), d.MAVLink(None, 1, 1)

    def take(number, time):
        message = d.MAVLink_attitude_message(0, *[0.0] * 6)
        vehicle.seq = number % 256
        message.pack(vehicle)
        reader.take(message, time)
        return max((lost for _, lost in reader._gaps), default=0)

    numbers = list(range(400))
    assert max(take(number, 5e-3 * number) for number in numbers) == 0
    assert take(400 - 174, 2.0) == 0  # seems to be 82 ahead
    assert take(400, 2.0) == 0
    assert take(404, 2.01) == 0  # three are missing: known with the next one
    assert take(405, 2.02) == 3
    assert max(take(number, 2.03 + 0.01 * number) for number in range(410, 1000, 5)) == 4
