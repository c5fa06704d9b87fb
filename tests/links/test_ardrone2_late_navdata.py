"""Late navdata: the emergency bit is toggled once, whatever the old navdata still show."""

import asyncio

import pytest
from deadtime import LinkError
from deadtime.links import run
from emulated import connected
from hypothesis import given, settings, strategies as st
from worst_case_drone import connected_drone


def cut(late, uplink=0.0, clear=True):
    """Cut the motors while navdata are late; return the toggles that the drone received."""
    seen = {}

    async def fly():
        async with connected_drone(late=late, uplink=uplink) as (drone, client):
            await client.take_off()
            await client.cut_motors()
            seen["cut"] = [on for _, on in drone.toggles]
            await asyncio.sleep(1.0)
            if clear:
                await client.clear_emergency()
                seen["cleared"] = [on for _, on in drone.toggles]
            assert drone.phase == "landed"

    run(fly())
    return seen


@pytest.mark.parametrize("late", [0.0, 0.2, 0.45, 0.9])
def test_motors_are_cut_once_however_late_the_confirmation(late):
    # A toggle repeated before the confirmation arrives would start the motors again.
    assert cut(late) == {"cut": [True], "cleared": [True, False]}


@settings(max_examples=20, deadline=None)
@given(total=st.floats(0.0, 0.95), share=st.floats(0.0, 1.0))
def test_motors_that_are_cut_never_start_again(total, share):
    found = cut(late=total * share, uplink=total * (1.0 - share))
    assert found == {"cut": [True], "cleared": [True, False]}


@pytest.mark.parametrize("late", [0.2, 0.45, 0.9])
def test_motors_of_the_emulator_are_cut_once(late):
    async def fly():
        async with connected(downlink=late) as (emulated, drone):
            await drone.take_off()
            flight, toggles = emulated.drone._flight, []
            plain = flight.toggle_emergency
            flight.toggle_emergency = lambda at: (toggles.append(at), plain(at))
            await drone.cut_motors()
            assert len(toggles) == 1
            assert emulated.truth().emergency

    run(fly())


def test_a_lost_toggle_is_sent_again():
    async def fly():
        async with connected_drone(late=0.2) as (drone, client):
            await client.take_off()
            socket = client._link._commands
            plain, lost = socket.sendto, []

            def lossy(data):  # The first toggle is lost with all its copies.
                if len(lost) < 3 and b",290717952\r" in data:
                    lost.append(data)
                else:
                    plain(data)

            socket.sendto = lossy
            await client.cut_motors()
            assert len(lost) == 3
            assert [on for _, on in drone.toggles] == [True]

    run(fly())


def test_navdata_buffered_during_a_pause_cause_no_second_toggle():
    # The navdata were sent before the drone received the toggle, and are read 1.5 s later.
    async def fly():
        async with connected_drone(uplink=0.3) as (drone, client):
            await client.take_off()
            cutting = asyncio.create_task(client.cut_motors())
            await asyncio.sleep(0.01)
            drone.pause_client(1.5)
            await cutting
            assert [on for _, on in drone.toggles] == [True]

    run(fly())


def test_without_navdata_the_toggle_is_not_repeated_and_an_error_is_raised():
    async def fly():
        async with connected_drone() as (drone, client):
            await client.take_off()
            drone._deliver = lambda packet: None
            with pytest.raises(LinkError, match="does not confirm"):
                await client.cut_motors()
            assert [on for _, on in drone.toggles] == [True]
            del drone._deliver

    run(fly())


@pytest.mark.parametrize("late", [0.0, 0.3, 0.6])
@pytest.mark.parametrize("after", [0.35, 0.5])
def test_navdata_from_before_a_take_off_do_not_confirm_a_landing(late, after):
    # The flight is cancelled as the drone begins to rise; old navdata still show it on the ground.
    async def fly():
        async with connected_drone(late=late, uplink=0.2) as (drone, client):
            taking_off = asyncio.create_task(client.take_off())
            await asyncio.sleep(after)
            taking_off.cancel()
            await asyncio.wait([taking_off])
            await client.land()
            assert drone.came_down > 0.0
            assert drone.phase == "landed"

    run(fly())
