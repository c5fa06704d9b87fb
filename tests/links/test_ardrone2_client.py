"""The client of the AR.Drone 2.0 on the emulator, in virtual time."""

import asyncio
import itertools
import math

import pytest
from deadtime import FlightAbortedError, LinkError
from deadtime.links import Limits, run
from deadtime.links.ardrone2 import ARDrone2, Navdata, build_navdata
from deadtime.links.ardrone2.commands import Ref, decode
from deadtime.links.ardrone2.connection import _PeerFilter
from deadtime.links.ardrone2.emulator import Phase
from deadtime.links.ardrone2.emulator.settings import Settings
from emulated import LIMITS, client_of, connected, emulator


def now():
    return asyncio.get_running_loop().time()


async def look(drone, often=0.02, hovering=True):
    """Read states until something is wrong."""
    while True:
        if hovering:
            drone.hover()
        await asyncio.sleep(often)
        await drone.state()


async def fall(drone):
    """Take off, then trip."""
    async with drone:
        await drone.take_off()
        drone.command(0.5)
        raise ZeroDivisionError


async def take_off_and_hover(emulated):
    """Fly until somebody ends it."""
    async with client_of(emulated) as drone:
        await drone.take_off()
        while True:
            drone.hover()
            await asyncio.sleep(0.05)


def watch_datagrams(drone):
    """Everything that the client sends from now on, with the time."""
    sent = []
    socket = drone._link._commands

    def sendto(data, plain=socket.sendto):
        sent.append((now(), decode(data)))
        plain(data)

    socket.sendto = sendto
    return sent


@pytest.mark.parametrize("full", [True, False])
def test_it_connects_flies_and_lands(full):
    async def fly():
        async with connected(full=full, noise=0.0) as (emulated, drone):
            assert drone.vz_max == 1.0
            assert (await drone.state()).landed
            assert emulated.truth().phase is Phase.LANDED  # connecting never takes off
            await drone.take_off()
            state = await drone.state()
            assert state.flying
            assert state.height == pytest.approx(0.75, abs=0.01)
            assert (state.climb is not None) is full
            for _ in range(40):
                assert drone.command(0.3) == pytest.approx(0.3, abs=1e-7)
                await asyncio.sleep(0.05)
            assert (
                0.75 + 0.3 * 0.885 * 1.5 < (await drone.state()).height < 0.75 + 0.3 * 0.885 * 1.8
            )
            await drone.land()
            assert (await drone.state()).landed
            await drone.land()  # twice is once
        assert emulated.truth().phase is Phase.LANDED
        statistics = drone.statistics
        assert statistics.missing == statistics.broken == statistics.implausible == 0
        assert statistics.rate == pytest.approx(200.0 if full else 15.0, rel=0.1)

    run(fly())


def test_speed_is_a_share_of_what_was_read_back():
    # The unit trap: at the drone's own default of 700 mm/s a command of 1 is 0.7 m/s.
    async def fly():
        async with connected(noise=0.0) as (emulated, drone):
            assert emulated.drone.settings.climb_limit == 1.0
            assert emulated.drone.settings.heights[1] == LIMITS.max_height
            await drone.take_off()
            sent = watch_datagrams(drone)
            drone.command(0.4)
            await asyncio.sleep(0.275)  # the emulator's transport delay is 0.26 s
            assert emulated.truth().setpoint == pytest.approx(0.4, abs=1e-6)
            moves = [c for _, commands in sent for _, c in commands if hasattr(c, "gaz")]
            assert moves[0].gaz == pytest.approx(0.4, abs=1e-6)

    run(fly())


def test_commands_are_clipped_and_what_is_no_number_is_refused():
    async def fly():
        async with connected(Limits(max_climb=0.5)) as (_, drone):
            with pytest.raises(LinkError, match="not in the air"):
                drone.command(0.1)
            await drone.take_off()
            assert drone.command(7.0) == pytest.approx(0.5)
            assert drone.command(-7.0) == pytest.approx(-0.5)
            for wrong in (math.nan, math.inf, -math.inf):
                with pytest.raises(ValueError, match="climb"):
                    drone.command(wrong)

    run(fly())


def test_every_cycle_repeats_the_wish_and_no_setpoint_is_repeated_when_it_is_old():
    async def fly():
        async with connected() as (emulated, drone):
            await drone.take_off()
            sent = watch_datagrams(drone)
            given = now()
            drone.command(0.5)
            with pytest.raises(FlightAbortedError, match=r"no command for 1\.0"):
                await look(drone, 0.01, hovering=False)
            assert now() - given == pytest.approx(LIMITS.landing_after, abs=0.05)
            times = [time for time, _ in sent]
            assert max(b - a for a, b in itertools.pairwise(times)) <= 0.0301
            for time, commands in sent:
                refs = [c for _, c in commands if isinstance(c, Ref)]
                moving = [c for _, c in commands if hasattr(c, "gaz") and c.flag]
                assert len(refs) == 1
                assert not refs[0].emergency
                assert bool(moving) is (time - given <= LIMITS.command_age)
                assert refs[0].take_off is (time - given <= LIMITS.landing_after)
            numbers = [number for _, commands in sent for number, _ in commands]
            assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
            with pytest.raises(FlightAbortedError, match="commanded to land"):
                drone.command(0.1)
            await asyncio.sleep(8.0)
            assert emulated.truth().phase is Phase.LANDED

    run(fly())


def test_take_off_is_held_until_the_transition_is_over():
    async def fly():
        async with connected() as (_, drone):
            sent = watch_datagrams(drone)
            begun = now()
            await drone.take_off()
            assert now() - begun > 4.5  # motors, rise and settling, as the vehicle does
            up = [c.take_off for _, commands in sent for _, c in commands if isinstance(c, Ref)]
            first = up.index(True)
            assert all(up[first:])
            names = [type(c).__name__ for _, commands in sent for _, c in commands]
            assert names.count("FlatTrim") == 1
            assert names.index("FlatTrim") < up.index(True) * 2  # on the ground, before

    run(fly())


@pytest.mark.parametrize("begun", [0.5, 2.0, 4.0])
def test_silence_while_taking_off_lands_it(begun):
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
            await drone.connect()
            taking_off = asyncio.create_task(drone.take_off())
            await asyncio.sleep(begun)
            drone._link.reader.accept = lambda packet, now: None  # commands still arrive
            lost = now()
            with pytest.raises(LinkError, match="nothing received"):
                await taking_off
            assert now() - lost < 1.2
            with pytest.raises(LinkError, match="while landing"):
                await drone.close()
            await asyncio.sleep(6.0)
            assert emulated.truth().phase is Phase.LANDED

    run(fly())


def test_an_emergency_while_taking_off_ends_it():
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
            await drone.connect()
            taking_off = asyncio.create_task(drone.take_off())
            await asyncio.sleep(2.0)
            drone._sender.cut = True
            with pytest.raises(FlightAbortedError, match="emergency while taking off"):
                await taking_off
            assert not drone._sender.in_air
            await drone.close()

    run(fly())


def test_an_exception_lands_it():
    seen = {}

    async def fly():
        async with emulator() as emulated:
            with pytest.raises(ZeroDivisionError):
                await fall(client_of(emulated))
            seen["phase"] = emulated.truth().phase

    run(fly())
    assert seen["phase"] is Phase.LANDED


@pytest.mark.parametrize("impatient", [False, True])
def test_cancelling_lands_it_also_when_cancelled_again(impatient):
    async def fly():
        async with emulator() as emulated:
            task = asyncio.create_task(take_off_and_hover(emulated))
            await asyncio.sleep(7.0)
            assert emulated.truth().phase is Phase.FLYING
            task.cancel()
            await asyncio.sleep(0.2)
            if impatient:
                task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            assert emulated.truth().phase is Phase.LANDED

    run(fly())


@pytest.mark.parametrize("packet", [1, 2, 5, 100, 600, 900])
def test_cancelling_is_not_lost_when_it_comes_with_a_packet(packet):
    # While connecting, at the 1st to 5th; while rising; in the air.
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
            take, count = drone._link.take, itertools.count(1)

            async def hover():
                async with drone:
                    await drone.take_off()
                    await look(drone)

            def cancelling(data):
                take(data)
                if next(count) == packet:
                    task.cancel()
                    cancelled.append(now())

            cancelled = []
            drone._link.take = cancelling
            task = asyncio.create_task(hover())
            done, _ = await asyncio.wait([task], timeout=15.0)
            assert done, "it flies on"
            assert task.cancelled()
            assert now() - cancelled[0] < 6.0
            assert emulated.truth().phase is Phase.LANDED

    run(fly())


def test_a_program_that_ends_without_closing_leaves_a_drone_that_lands():
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
            await drone.connect()
            await drone.take_off()
            drone.command(0.3)
            drone._link._cycle.cancel()  # what the end of the event loop does to its tasks
            await asyncio.sleep(0.1)
            assert emulated.truth().phase is Phase.LANDING
            drone._link.shut()

    run(fly())


def test_silence_in_flight_is_told_and_landing_ends_in_bounded_time():
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
            await drone.connect()
            await drone.take_off()
            drone._link.reader.accept = lambda packet, now: (
                None
            )  # navdata no longer arrive, commands do
            lost = now()
            with pytest.raises(LinkError, match="nothing received"):
                await look(drone)
            assert now() - lost == pytest.approx(1.0, abs=0.05)
            with pytest.raises(LinkError, match="while landing"):
                await drone.close()
            assert now() - lost < 5.0
            await asyncio.sleep(3.0)
            assert emulated.truth().phase is Phase.LANDED

    run(fly())


def test_a_landing_is_confirmed_also_by_a_drone_that_forgot_its_client():
    # A program that was stopped for a while: the drone's watchdog has landed it.
    async def fly():
        async with connected() as (emulated, drone):
            await drone.take_off()
            socket = drone._link._commands
            plain, socket.sendto = socket.sendto, lambda data: None
            await asyncio.sleep(6.0)
            socket.sendto = plain
            begun = now()
            await drone.land()
            assert now() - begun < 3.0
            assert emulated.truth().phase is Phase.LANDED
            assert (drone._reader.navdata.bootstrap, drone._reader.navdata.demo) == (True, None)

    run(fly())


def test_a_dead_drone_ends_the_context_in_bounded_time():
    async def fly():
        async with emulator() as emulated:

            async def strand():
                async with client_of(emulated) as drone:
                    await drone.take_off()
                    await emulated.close()
                    stranded.append(now())
                    await look(drone)

            stranded = []
            with pytest.raises(LinkError, match="nothing received"):
                await strand()
            assert now() - stranded[0] < 5.0

    run(fly())


def test_a_landing_that_nobody_confirms_is_noted_on_what_ended_the_flight():
    async def fly():
        async with emulator() as emulated:
            task = asyncio.create_task(take_off_and_hover(emulated))
            await asyncio.sleep(7.0)
            await emulated.close()
            task.cancel()
            with pytest.raises(asyncio.CancelledError) as ended:
                await task
            assert "while landing" in ended.value.__notes__[0]

    run(fly())


def test_it_is_noted_also_when_the_landing_itself_was_cancelled():
    async def fly():
        async with emulator() as emulated:

            async def hop():
                async with client_of(emulated) as drone:
                    await drone.take_off()
                    await emulated.close()

            task = asyncio.create_task(hop())
            await asyncio.sleep(8.0)
            task.cancel()
            with pytest.raises(asyncio.CancelledError) as ended:
                await task
            assert "while landing" in ended.value.__notes__[0]

    run(fly())


@pytest.mark.parametrize(
    "wrong", [{"navdata_port": 99999}, {"command_port": -1}, {"control_port": 0}]
)
def test_a_port_that_is_none_is_refused(wrong):
    with pytest.raises(ValueError, match="is no port"):
        ARDrone2("127.0.0.1", **wrong)


def test_forged_navdata_from_another_port_are_ignored():
    async def fly():
        async with connected() as (_, drone):
            await drone.take_off()
            state = await drone.state()
            forged = build_navdata(Navdata(1 << 31, state.sequence + 50))
            loop = asyncio.get_running_loop()
            door = drone._link._navdata.get_extra_info("sockname")
            stranger, _ = await loop.create_datagram_endpoint(
                asyncio.DatagramProtocol, local_addr=("127.0.0.1", 0)
            )
            for _ in range(20):
                stranger.sendto(forged, door)
                drone.hover()
                await asyncio.sleep(0.02)
                assert not (await drone.state()).emergency
            assert drone.statistics.implausible == 0
            stranger.close()

    run(fly())


def test_what_a_socket_hands_on_from_elsewhere_is_counted_and_dropped():
    # A system that filters less than it should: the protocol checks address and port itself.
    async def fly():
        async with connected() as (_, drone):
            door = _PeerFilter(drone._link.take, drone._link.reader.refuse)
            door._peer = ("127.0.0.1", 5554)
            before = (await drone.state()).sequence
            forged = build_navdata(Navdata(1 << 31, before + 1))
            door.datagram_received(forged, ("127.0.0.1", 5555))
            door.datagram_received(forged, ("127.0.0.2", 5554))
            assert drone.statistics.foreign == 2
            assert not (await drone.state()).emergency

    run(fly())


@pytest.mark.parametrize("key", ["control:control_vz_max", "control:altitude_max"])
def test_without_its_limits_read_back_it_does_not_connect(key, monkeypatch):
    plain = Settings.set
    monkeypatch.setattr(
        Settings, "set", lambda self, name, value: name == key or plain(self, name, value)
    )

    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated, Limits(max_height=2.5))
            with pytest.raises(LinkError, match=rf"{key} = .* reads back"):
                await drone.connect()
            with pytest.raises(LinkError, match="not connected"):
                await drone.take_off()
            await asyncio.sleep(3.0)
            assert emulated.truth().phase is Phase.LANDED

    run(fly())


def test_a_setting_that_is_never_acknowledged_ends_the_handshake(monkeypatch):
    monkeypatch.setattr(Settings, "set", lambda self, name, value: False)

    async def fly():
        async with emulator() as emulated:
            begun = now()
            with pytest.raises(LinkError, match="does not acknowledge general:navdata_demo"):
                await client_of(emulated).connect()
            assert now() - begun < 5.0

    run(fly())


@pytest.mark.parametrize(
    ("piece", "said"),
    [(b"x" * 100_000, "no end within 65536 bytes"), (b"x", "nothing received for 2 s")],
)
def test_settings_that_never_end_are_not_waited_for(piece, said):
    async def trickle(reader, writer):
        for _ in range(6):
            writer.write(piece)
            await asyncio.sleep(0.5)
        writer.close()

    async def fly():
        async with emulator() as emulated:
            server = await asyncio.start_server(trickle, "127.0.0.1", 0)
            drone = client_of(emulated)
            drone.control_port = server.sockets[0].getsockname()[1]
            begun = now()
            with pytest.raises(LinkError, match=said):
                await drone.connect()
            assert now() - begun < 10.0
            await asyncio.sleep(3.5)
            server.close()

    run(fly())


def test_nobody_there_is_told():
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
        with pytest.raises(LinkError, match=r"no navdata from 127\.0\.0\.1"):
            await drone.connect()

    run(fly())


def test_an_empty_battery_stays_on_the_ground():
    async def fly():
        async with connected(battery=15.0) as (emulated, drone):
            with pytest.raises(LinkError, match=r"battery of 127\.0\.0\.1 is at 1"):
                await drone.take_off()
            assert emulated.truth().phase is Phase.LANDED

    run(fly())


def test_cutting_the_motors_is_a_thing_of_its_own():
    async def fly():
        async with connected() as (emulated, drone):
            await drone.take_off()
            sent = watch_datagrams(drone)
            await drone.land()
            assert not any(c.emergency for _, some in sent for _, c in some if isinstance(c, Ref))
            await drone.take_off()
            await drone.cut_motors()
            assert emulated.truth().emergency
            await asyncio.sleep(2.0)
            with pytest.raises(LinkError, match="emergency"):
                await drone.take_off()
            await drone.clear_emergency()
            assert not emulated.truth().emergency
            await drone.take_off()

    run(fly())


def test_a_listener_that_fails_is_told_with_the_next_state():
    # A full disk under the file of all messages.
    async def fly():
        async with connected() as (_, drone):
            calls = []

            def full(state):
                calls.append(state)
                raise OSError("no space left")

            drone.listen(full)
            with pytest.raises(LinkError, match="no space left"):
                await look(drone, 0.1)
            assert len(calls) == 1

    run(fly())


def test_a_drone_that_forgot_its_client_is_not_flown_on():
    async def fly():
        async with connected() as (emulated, drone):
            await drone.take_off()
            emulated.drone._bootstrap, emulated.drone._sequence = True, 0  # it was restarted
            with pytest.raises(LinkError, match="restarted its count"):
                await look(drone)
            emulated.drone._bootstrap = False

    run(fly())
