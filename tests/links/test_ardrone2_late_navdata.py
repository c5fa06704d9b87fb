"""News that are late: the emergency is toggled once, whatever they still show."""

import asyncio

import pytest
from deadtime import LinkError
from deadtime.links import run
from emulated import connected
from hypothesis import given, settings
from hypothesis import strategies as st
from worst_case_drone import connected_drone


def cut(late, uplink=0.0, clear=True):
    """Cut the motors in flight, with news that are late, and see what the drone was toggled to."""
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
    # On at 0, off again at 0.2 s and reported as confirmed; with 0.45 s on, off, on.
    assert cut(late) == {"cut": [True], "cleared": [True, False]}


@settings(max_examples=40, deadline=None)
@given(way=st.floats(0.0, 0.95), share=st.floats(0.0, 1.0))
def test_motors_that_are_cut_never_come_on_again(way, share):
    found = cut(late=way * share, uplink=way * (1.0 - share))
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


def test_a_toggle_that_was_lost_is_sent_again():
    async def fly():
        async with connected_drone(late=0.2) as (drone, client):
            await client.take_off()
            socket = client._link._commands
            plain, lost = socket.sendto, []

            def lossy(data):  # the first toggle with all its copies
                if len(lost) < 3 and b",290717952\r" in data:
                    lost.append(data)
                else:
                    plain(data)

            socket.sendto = lossy
            await client.cut_motors()
            assert len(lost) == 3
            assert [on for _, on in drone.toggles] == [True]

    run(fly())


def test_what_waited_in_the_socket_during_a_pause_has_nothing_toggled_again():
    # News from before the drone heard of it, read 1.5 s later.
    async def fly():
        async with connected_drone(uplink=0.3) as (drone, client):
            await client.take_off()
            cutting = asyncio.create_task(client.cut_motors())
            await asyncio.sleep(0.01)
            drone.pause_client(1.5)
            await cutting
            assert [on for _, on in drone.toggles] == [True]

    run(fly())


def test_a_drone_that_says_nothing_is_not_toggled_again_and_that_is_said():
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
def test_news_from_before_a_take_off_confirm_no_landing(late, after):
    # Cancelled as it began to rise, it was said to be down because it had not been seen to rise.
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
