"""A second client of the same drone, and a drone that lands by itself, are detected and named."""

import asyncio
import contextlib

import pytest
from deadtime import FlightAbortedError, LinkError
from deadtime.links import run
from deadtime.links.ardrone2.commands import Move, Ref, encode
from deadtime.links.ardrone2.emulator import Phase
from deadtime.links.ardrone2.navdata import State
from emulated import client_of, emulator
from worst_case_drone import connected_drone


async def hover_until_error(client, turns=100):
    """Hover and read states until an error ends the flight."""
    for _ in range(turns):
        await asyncio.sleep(0.02)
        await client.state()
        client.hover()


async def connect_beside(emulated):
    """Connect a second client of this package, from the same machine."""
    await asyncio.sleep(0.3)
    second = client_of(emulated)
    with contextlib.suppress(LinkError):
        await second.connect()
    with contextlib.suppress(LinkError):
        await second.close()


def test_a_second_client_of_the_emulator_is_named_in_the_error_of_the_first():
    # The first datagram of the second client lands the drone while the first still requests flight.
    # If the drone sends navdata to the newer client, the first only notices that they are missing.
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
            await drone.connect()
            await drone.take_off()
            beside = asyncio.create_task(connect_beside(emulated))
            with pytest.raises(FlightAbortedError, match="another client"):
                await hover_until_error(drone)
            assert not drone._sender.in_air
            with pytest.raises(LinkError, match="another client"):
                drone.hover()
            await asyncio.sleep(4.0)
            assert emulated.truth().phase is Phase.LANDED
            with contextlib.suppress(LinkError):
                await drone.close()
            await beside

    run(fly())


@pytest.mark.parametrize("number", [1, 5000])
@pytest.mark.parametrize("ref", [Ref(), Ref(take_off=True)])
@pytest.mark.parametrize("short", [False, True])
def test_a_datagram_of_another_client_is_detected_if_the_drone_reports_it(number, ref, short):
    # Short navdata have no number of the last REF: only the landing itself can be seen.
    async def fly():
        async with connected_drone(tick=0.005, options=("short",) if short else ()) as (
            drone,
            client,
        ):
            await client.take_off()
            await hover_until_error(client, 5)
            before = len(drone.received)
            while len(drone.received) == before:  # until this client sends again
                await asyncio.sleep(0.001)
            drone.receive_commands(encode([ref, Move(flag=0)], number), None)
            if short and ref.take_off:
                return
            with pytest.raises(FlightAbortedError, match="another client"):
                await hover_until_error(client)
            assert not any(
                one.take_off
                for sent, commands, came_down in drone.received
                for one in commands
                if isinstance(one, Ref) and 0.0 < came_down < sent - 0.05
            )

    run(fly())


def test_another_client_detected_on_the_ground_prevents_take_off():
    async def fly():
        async with connected_drone(tick=0.005) as (drone, client):
            drone.receive_commands(encode([Ref()], 5000), None)
            await asyncio.sleep(0.1)
            with pytest.raises(LinkError, match="another client"):
                await client.take_off()
            assert drone.phase == "landed"

    run(fly())


def test_own_commands_are_not_attributed_to_another_client():
    async def fly():
        async with connected_drone(uplink=0.2, late=0.3) as (_, client):
            await client.take_off()
            await hover_until_error(client, 400)
            await client.land()
            await client.take_off()
            await hover_until_error(client, 20)

    run(fly())


FAULTS = [(State.BATTERY_LOW, "its battery"), (State.MOTORS_PROBLEM, "a motor")]


@pytest.mark.parametrize(("fault", "message"), FAULTS)
def test_a_landing_for_a_fault_is_not_attributed_to_another_client(fault, message):
    async def fly():
        async with connected_drone(tick=0.005) as (drone, client):
            await client.take_off()
            drone.fault = fault
            drone._enter("landing", drone.time)
            with pytest.raises(FlightAbortedError, match=f"lands by itself: {message}"):
                await hover_until_error(client)

    run(fly())


def test_a_drone_that_lands_by_itself_is_not_asked_to_take_off_again():
    # A drone that obeys the level of the take-off bit would rise again if it were still set.
    async def fly():
        async with connected_drone(tick=0.005) as (drone, client):
            await client.take_off()
            drone._enter("landing", drone.time)
            drone.came_down = landed = drone.time
            with pytest.raises(FlightAbortedError, match="Most likely another client"):
                await hover_until_error(client)
            await asyncio.sleep(2.0)
            assert drone.phase == "landed"
            later = [
                one for sent, some, _ in drone.received if sent > landed + 0.05 for one in some
            ]
            assert not any(one.take_off for one in later if isinstance(one, Ref))

    run(fly())
