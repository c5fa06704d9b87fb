"""Pauses of the client's program: a drone that has landed is never asked to take off again."""

import asyncio
import contextlib
import os
import signal
import sys
import time

import pytest
from deadtime import FlightAbortedError, LinkError
from deadtime.links import Limits, clock, run
from deadtime.links.ardrone2.commands import Move, Ref
from deadtime.links.ardrone2.emulator import Phase
from deadtime.links.ardrone2.sender import CYCLE, CommandSender
from emulated import emulator, skip_if_too_busy
from hypothesis import example, given, settings, strategies as st
from worst_case_drone import connected_drone


def now():
    return asyncio.get_running_loop().time()


def refs(received):
    """For each datagram: when it was sent, and whether it requests flight (None: no REF in it)."""
    for sent, commands, _ in received:
        requests = [one.take_off for one in commands if isinstance(one, Ref)]
        yield sent, requests[0] if requests else None


async def continue_program(client, how, times=1):
    """What a program does next if it does not notice its pause."""
    for _ in range(times):
        if how == "hover":
            client.hover()
        elif how == "command":
            client.command(0.3)
        elif how == "state":
            await client.state()
        await asyncio.sleep(0.05)
    await client.state()


@pytest.mark.parametrize("going_on", ["hover", "command", "state", "nothing"])
@pytest.mark.parametrize("pause", [2.1, 9.0])
def test_after_a_pause_beyond_the_watchdog_a_landed_drone_is_not_asked_to_take_off(pause, going_on):
    # If the event loop is blocked for 9 s, `hover()` must not send take-off to a landed drone.
    async def fly():
        async with connected_drone() as (drone, client):
            await client.take_off()
            client.command(0.3)
            drone.pause_client(pause)
            went_on = now()
            with pytest.raises(FlightAbortedError, match=rf"was paused for {pause:.0f}\."):
                await continue_program(client, going_on)
            with pytest.raises(FlightAbortedError, match="commanded to land"):
                client.hover()
            await asyncio.sleep(0.5)
            assert drone.phase == "landed"
            later = [asked for sent, asked in refs(drone.received) if sent >= went_on]
            assert len(later) > 10
            assert set(later) == {False}

    run(fly())


@pytest.mark.parametrize("pause", [0.26, 0.6, 0.9])
def test_after_a_short_pause_flight_is_requested_only_when_the_drone_is_known_to_fly(pause):
    async def fly():
        async with connected_drone(late=0.1) as (drone, client):
            await client.take_off()
            client.command(0.3)
            drone.pause_client(pause)
            went_on = now()
            assert client.command(0.3) == 0.0
            for _ in range(20):
                await asyncio.sleep(0.02)
                client.command(0.3)
            # The first navdata sent after the pause arrive 0.1 s later.
            requests = [
                (sent - went_on, up) for sent, up in refs(drone.received) if sent >= went_on
            ]
            assert all(up is None for passed, up in requests if passed < 0.1)
            assert all(up is True for passed, up in requests if passed > 0.1 + 3 * CYCLE)
            moves = [
                one.flag
                for sent, commands, _ in drone.received
                for one in commands
                if isinstance(one, Move) and went_on <= sent < went_on + 0.1
            ]
            assert set(moves) == {0}
            assert drone.gaz == pytest.approx(0.3)
            assert drone.came_down < 0.0

    run(fly())


def test_a_pause_ends_the_flight_if_no_clock_dates_the_navdata():
    async def fly():
        async with connected_drone(options=("short",)) as (drone, client):
            await client.take_off()
            drone.pause_client(0.5)
            went_on = now()
            with pytest.raises(FlightAbortedError, match="since a pause of this program"):
                await continue_program(client, "hover", 60)
            assert True not in [up for sent, up in refs(drone.received) if sent >= went_on]

    run(fly())


def test_a_pause_just_before_take_off_leaves_the_drone_on_the_ground():
    async def fly():
        async with connected_drone() as (drone, client):
            asyncio.get_running_loop().call_later(0.1, drone.pause_client, 5.0)
            with pytest.raises(LinkError, match="just before"):
                await client.take_off()
            assert not any(up for _, up in refs(drone.received))

    run(fly())


LENGTHS = st.one_of(st.floats(0.01, 0.3), st.floats(0.25, 2.1), st.floats(1.9, 9.0))
PAUSES = st.lists(st.tuples(st.floats(0.0, 3.0), LENGTHS), min_size=1, max_size=3)


@settings(max_examples=25, deadline=None)
@given(
    pauses=PAUSES, own=st.lists(LENGTHS, max_size=2), every=st.integers(3, 9), late=st.booleans()
)
@example(pauses=[(0.5, 1.99), (2.5, 0.3)], own=[1.99], every=3, late=True)
@example(pauses=[(0.2, 5.0)], own=[], every=3, late=False)
def test_no_pause_makes_a_landed_drone_be_asked_to_take_off(pauses, own, every, late):
    # The whole program pauses at any moment, and so does the code between two commands.
    async def fly():
        async with connected_drone(late=0.03 if late else 0.0) as (drone, client):
            loop, left = asyncio.get_running_loop(), list(own)
            asked = now()
            for begin, length in pauses:
                loop.call_later(begin, drone.pause_client, length)
            with contextlib.suppress(LinkError):
                await client.take_off()
                for turn in range(50):
                    await client.state()
                    if left and turn % every == 0:
                        drone.pause_client(left.pop())
                    client.command(0.3) if turn % 2 else client.hover()
                    await asyncio.sleep(0.05)
            with contextlib.suppress(LinkError):
                await client.land()
            await asyncio.sleep(3.0)
            for (_, up), (_, _, came_down) in zip(
                refs(drone.received), drone.received, strict=True
            ):
                assert not (up and asked <= came_down)
            assert drone.phase == "landed"

    run(fly())


@pytest.mark.parametrize("out", [1.5, 2.5, 6.0])
def test_a_drone_that_landed_during_a_radio_outage_is_not_asked_to_take_off(out):
    # The program only hovers, and its commands are received again when the outage ends.
    async def fly():
        async with connected_drone() as (drone, client):
            await client.take_off()
            socket, begun = client._link._commands, now()
            plain, deliver = socket.sendto, drone._deliver
            socket.sendto, drone._deliver = (lambda data: None), (lambda packet: None)
            ended = None
            while now() < begun + out + 1.0:
                if now() > begun + out and socket.sendto is not plain:
                    socket.sendto, drone._deliver = plain, deliver
                try:
                    client.hover()
                except FlightAbortedError as error:
                    ended = error
                await asyncio.sleep(0.05)
            assert "nothing has been received from 127.0.0.1 for 1.0 s" in str(ended)
            assert drone.phase == "landed"
            later = [up for sent, up in refs(drone.received) if sent > begun + 0.05]
            assert len(later) > 10
            assert True not in later

    run(fly())


def test_message_ages_include_the_time_in_which_the_machine_sleeps(monkeypatch):
    # For example a laptop closed in flight: the event loop's clock stands still meanwhile.
    if not hasattr(time, "CLOCK_BOOTTIME"):
        pytest.skip("this system has no clock that counts sleep beside one that does not")
    plain, slept = time.clock_gettime, []

    def slept_for(number):
        return plain(number) + (sum(slept) if number == time.CLOCK_BOOTTIME else 0.0)

    monkeypatch.setattr(time, "clock_gettime", slept_for)

    async def look():
        sender = CommandSender(Limits())
        sender.fly()
        sender.datagram(clock.now())
        before, by_loop = clock.now(), now()
        slept.append(3600.0)
        assert clock.now() - before >= 3600.0
        assert now() - by_loop < 1000.0
        sender.hover(clock.now())
        assert not sender.in_air
        assert "was paused for 360" in sender.expired

    asyncio.run(look())


def test_without_a_clock_that_counts_sleep_the_event_loop_s_clock_is_used(monkeypatch):
    monkeypatch.delattr(time, "CLOCK_BOOTTIME", raising=False)
    assert abs(clock._counted() - time.monotonic()) < 1e6
    assert clock._counted() <= clock._counted()


STOPPED = """
import asyncio, sys
from deadtime.links import Limits
from deadtime.links.ardrone2 import ARDrone2

async def main():
    ports = dict(zip(("navdata_port", "command_port", "control_port"), map(int, sys.argv[1:])))
    async with ARDrone2("127.0.0.1", Limits(max_climb=1.0), **ports) as drone:
        await drone.take_off()
        print("up", flush=True)
        while True:
            drone.command(0.1)
            await asyncio.sleep(0.05)

asyncio.run(main())
"""


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="this system stops no process")
def test_a_client_process_that_was_stopped_in_flight_does_not_restart_a_landed_drone():
    # SIGSTOP until the drone has landed itself, then SIGCONT: no take-off may be sent.
    async def fly():
        async with emulator() as emulated:
            ports = (emulated.navdata_port, emulated.command_port, emulated.control_port)
            process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-c", STOPPED, *map(str, ports)),
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE,
            )
            try:
                if not await asyncio.wait_for(process.stdout.readline(), 60.0):
                    skip_if_too_busy((await process.communicate())[1].decode())
                    raise AssertionError("the client did not take off")
                process.send_signal(signal.SIGSTOP)
                for _ in range(300):
                    await asyncio.sleep(0.1)
                    if emulated.truth().phase is Phase.LANDED:
                        break
                assert emulated.truth().phase is Phase.LANDED
                await asyncio.sleep(0.3)
                datagrams, plain = [], emulated.drone.commanded
                emulated.drone.commanded = lambda data, source, at: (
                    datagrams.append(data),
                    plain(data, source, at),
                )
                process.send_signal(signal.SIGCONT)
                _, error = await asyncio.wait_for(process.communicate(), 60.0)
                assert datagrams
                assert not any(b"AT*REF" in one and b",290718208\r" in one for one in datagrams)
                assert emulated.truth().phase is Phase.LANDED
                assert process.returncode == 1
                assert "FlightAbortedError: this program was paused for" in error.decode()
            finally:
                if process.returncode is None:
                    os.kill(process.pid, signal.SIGCONT)
                    process.kill()
                    await process.communicate()

    asyncio.run(fly())
