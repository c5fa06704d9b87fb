"""The client of the AR.Drone 2.0 on the emulator, in virtual time.

One subject, kept in one file: every test connects the same client to the same emulator.
"""

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


async def read_states(drone, often=0.02, hovering=True):
    """Read states until an error ends the flight."""
    while True:
        if hovering:
            drone.hover()
        await asyncio.sleep(often)
        await drone.state()


async def take_off_and_fail(drone):
    """Take off, then raise an exception."""
    async with drone:
        await drone.take_off()
        drone.command(0.5)
        raise ZeroDivisionError


async def take_off_and_hover(emulated):
    """Take off and hover until something ends the flight."""
    async with client_of(emulated) as drone:
        await drone.take_off()
        while True:
            drone.hover()
            await asyncio.sleep(0.05)


def record_datagrams(drone):
    """Record everything that the client sends from now on, with its time."""
    sent = []
    socket = drone._link._commands

    def sendto(data, plain=socket.sendto):
        sent.append((now(), decode(data)))
        plain(data)

    socket.sendto = sendto
    return sent


@pytest.mark.parametrize("full", [True, False])
def test_connect_take_off_command_and_land(full):
    async def fly():
        async with connected(full=full, noise=0.0) as (emulated, drone):
            assert drone.vz_max == 1.0
            assert (await drone.state()).landed
            assert emulated.truth().phase is Phase.LANDED  # Connecting never takes off.
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
            await drone.land()  # A second call has no effect.
        assert emulated.truth().phase is Phase.LANDED
        statistics = drone.statistics
        assert statistics.missing == statistics.broken == statistics.implausible == 0
        assert statistics.rate == pytest.approx(200.0 if full else 15.0, rel=0.1)

    run(fly())


def test_climb_command_is_scaled_by_the_largest_climb_read_back():
    # At the drone's own default of 700 mm/s a command of 1 means 0.7 m/s.
    async def fly():
        async with connected(noise=0.0) as (emulated, drone):
            assert emulated.drone.settings.climb_limit == 1.0
            assert emulated.drone.settings.heights[1] == LIMITS.max_height
            await drone.take_off()
            sent = record_datagrams(drone)
            drone.command(0.4)
            await asyncio.sleep(0.275)  # The emulator's transport delay is 0.26 s.
            assert emulated.truth().setpoint == pytest.approx(0.4, abs=1e-6)
            moves = [c for _, commands in sent for _, c in commands if hasattr(c, "gaz")]
            assert moves[0].gaz == pytest.approx(0.4, abs=1e-6)

    run(fly())


def test_commands_are_clipped_and_non_numbers_refused():
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


def test_every_cycle_sends_the_flight_request_and_an_old_setpoint_is_not_repeated():
    async def fly():
        async with connected() as (emulated, drone):
            await drone.take_off()
            sent = record_datagrams(drone)
            given = now()
            drone.command(0.5)
            with pytest.raises(FlightAbortedError, match=r"no command was given for 1\.0"):
                await read_states(drone, 0.01, hovering=False)
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


def test_take_off_bit_is_set_until_the_transition_ends():
    async def fly():
        async with connected() as (_, drone):
            sent = record_datagrams(drone)
            begun = now()
            await drone.take_off()
            assert now() - begun > 4.5  # The motors start, it rises and settles.
            up = [c.take_off for _, commands in sent for _, c in commands if isinstance(c, Ref)]
            first = up.index(True)
            assert all(up[first:])
            names = [type(c).__name__ for _, commands in sent for _, c in commands]
            assert names.count("FlatTrim") == 1
            assert names.index("FlatTrim") < up.index(True) * 2  # On the ground, before take-off.

    run(fly())


@pytest.mark.parametrize("begun", [0.5, 2.0, 4.0])
def test_missing_navdata_during_take_off_lands_the_drone(begun):
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
            await drone.connect()
            taking_off = asyncio.create_task(drone.take_off())
            await asyncio.sleep(begun)
            drone._link.reader.accept = lambda packet, now: None  # Commands still arrive.
            lost = now()
            with pytest.raises(LinkError, match="nothing has been received"):
                await taking_off
            assert now() - lost < 1.2
            with pytest.raises(LinkError, match="during the landing"):
                await drone.close()
            await asyncio.sleep(6.0)
            assert emulated.truth().phase is Phase.LANDED

    run(fly())


def test_an_emergency_during_take_off_ends_the_flight():
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
            await drone.connect()
            taking_off = asyncio.create_task(drone.take_off())
            await asyncio.sleep(2.0)
            drone._sender.cut = True
            with pytest.raises(FlightAbortedError, match="emergency during the take-off"):
                await taking_off
            assert not drone._sender.in_air
            await drone.close()

    run(fly())


def test_an_exception_lands_the_drone():
    seen = {}

    async def fly():
        async with emulator() as emulated:
            with pytest.raises(ZeroDivisionError):
                await take_off_and_fail(client_of(emulated))
            seen["phase"] = emulated.truth().phase

    run(fly())
    assert seen["phase"] is Phase.LANDED


@pytest.mark.parametrize("impatient", [False, True])
def test_cancelling_lands_the_drone_even_when_cancelled_again(impatient):
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
def test_a_cancellation_that_coincides_with_a_packet_is_not_lost(packet):
    # While connecting, at the 1st to 5th packet; while rising; in flight.
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
            take, count = drone._link.take, itertools.count(1)

            async def hover():
                async with drone:
                    await drone.take_off()
                    await read_states(drone)

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


def test_a_program_that_ends_without_closing_lands_the_drone():
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
            await drone.connect()
            await drone.take_off()
            drone.command(0.3)
            drone._link._cycle.cancel()  # The end of an event loop cancels its tasks in this way.
            await asyncio.sleep(0.1)
            assert emulated.truth().phase is Phase.LANDING
            drone._link.shut()

    run(fly())


def test_missing_navdata_in_flight_raise_and_landing_ends_in_bounded_time():
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
            await drone.connect()
            await drone.take_off()
            drone._link.reader.accept = lambda packet, now: (
                None
            )  # Navdata no longer arrive, but commands do.
            lost = now()
            with pytest.raises(LinkError, match="nothing has been received"):
                await read_states(drone)
            assert now() - lost == pytest.approx(1.0, abs=0.05)
            with pytest.raises(LinkError, match="during the landing"):
                await drone.close()
            assert now() - lost < 5.0
            await asyncio.sleep(3.0)
            assert emulated.truth().phase is Phase.LANDED

    run(fly())


def test_landing_is_confirmed_by_a_drone_that_has_dropped_its_client():
    # After a long pause of the program the drone's watchdog has landed it.
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


def test_a_drone_that_stops_answering_ends_the_context_in_bounded_time():
    async def fly():
        async with emulator() as emulated:

            async def fly_until_silence():
                async with client_of(emulated) as drone:
                    await drone.take_off()
                    await emulated.close()
                    closed_at.append(now())
                    await read_states(drone)

            closed_at = []
            with pytest.raises(LinkError, match="nothing has been received"):
                await fly_until_silence()
            assert now() - closed_at[0] < 5.0

    run(fly())


def test_an_unconfirmed_landing_is_noted_on_the_error_that_ended_the_flight():
    async def fly():
        async with emulator() as emulated:
            task = asyncio.create_task(take_off_and_hover(emulated))
            await asyncio.sleep(7.0)
            await emulated.close()
            task.cancel()
            with pytest.raises(asyncio.CancelledError) as ended:
                await task
            assert "during the landing" in ended.value.__notes__[0]

    run(fly())


def test_an_unconfirmed_landing_is_noted_when_the_landing_was_cancelled():
    async def fly():
        async with emulator() as emulated:

            async def take_off_and_leave():
                async with client_of(emulated) as drone:
                    await drone.take_off()
                    await emulated.close()

            task = asyncio.create_task(take_off_and_leave())
            await asyncio.sleep(8.0)
            task.cancel()
            with pytest.raises(asyncio.CancelledError) as ended:
                await task
            assert "during the landing" in ended.value.__notes__[0]

    run(fly())


@pytest.mark.parametrize(
    "wrong", [{"navdata_port": 99999}, {"command_port": -1}, {"control_port": 0}]
)
def test_an_invalid_port_is_refused(wrong):
    with pytest.raises(ValueError, match="give a port"):
        ARDrone2("127.0.0.1", **wrong)


def test_navdata_from_another_port_are_ignored():
    async def fly():
        async with connected() as (_, drone):
            await drone.take_off()
            state = await drone.state()
            forged = build_navdata(Navdata(1 << 31, state.sequence + 50))
            loop = asyncio.get_running_loop()
            address = drone._link._navdata.get_extra_info("sockname")
            sender, _ = await loop.create_datagram_endpoint(
                asyncio.DatagramProtocol, local_addr=("127.0.0.1", 0)
            )
            for _ in range(20):
                sender.sendto(forged, address)
                drone.hover()
                await asyncio.sleep(0.02)
                assert not (await drone.state()).emergency
            assert drone.statistics.implausible == 0
            sender.close()

    run(fly())


def test_datagrams_from_another_address_are_counted_and_dropped():
    # The system may filter less than it should, so the protocol checks address and port itself.
    async def fly():
        async with connected() as (_, drone):
            peer_filter = _PeerFilter(drone._link.take, drone._link.reader.refuse)
            peer_filter._peer = ("127.0.0.1", 5554)
            before = (await drone.state()).sequence
            forged = build_navdata(Navdata(1 << 31, before + 1))
            peer_filter.datagram_received(forged, ("127.0.0.1", 5555))
            peer_filter.datagram_received(forged, ("127.0.0.2", 5554))
            assert drone.statistics.foreign == 2
            assert not (await drone.state()).emergency

    run(fly())


@pytest.mark.parametrize("key", ["control:control_vz_max", "control:altitude_max"])
def test_connecting_fails_unless_the_limits_are_read_back(key, monkeypatch):
    plain = Settings.set
    monkeypatch.setattr(
        Settings, "set", lambda self, name, value: name == key or plain(self, name, value)
    )

    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated, Limits(max_height=2.5))
            with pytest.raises(LinkError, match=rf"{key} was set to .* the drone reports"):
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
    ("piece", "message"),
    [
        (b"x" * 100_000, "its end is missing after 65536 bytes"),
        (b"x", "nothing has been received for 2 s"),
    ],
)
def test_a_configuration_without_end_is_not_waited_for(piece, message):
    async def send_without_end(reader, writer):
        for _ in range(6):
            writer.write(piece)
            await asyncio.sleep(0.5)
        writer.close()

    async def fly():
        async with emulator() as emulated:
            server = await asyncio.start_server(send_without_end, "127.0.0.1", 0)
            drone = client_of(emulated)
            drone.control_port = server.sockets[0].getsockname()[1]
            begun = now()
            with pytest.raises(LinkError, match=message):
                await drone.connect()
            assert now() - begun < 10.0
            await asyncio.sleep(3.5)
            server.close()

    run(fly())


def test_connecting_without_a_drone_raises_a_named_error():
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
        with pytest.raises(LinkError, match=r"no navdata has arrived from 127\.0\.0\.1"):
            await drone.connect()

    run(fly())


def test_an_empty_battery_prevents_take_off():
    async def fly():
        async with connected(battery=15.0) as (emulated, drone):
            with pytest.raises(LinkError, match=r"battery of 127\.0\.0\.1 is at 1"):
                await drone.take_off()
            assert emulated.truth().phase is Phase.LANDED

    run(fly())


def test_cut_motors_is_separate_from_landing():
    async def fly():
        async with connected() as (emulated, drone):
            await drone.take_off()
            sent = record_datagrams(drone)
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


def test_an_error_of_a_listener_is_raised_with_the_next_state():
    # For example, the disk is full when the listener writes all messages to a file.
    async def fly():
        async with connected() as (_, drone):
            calls = []

            def raise_disk_full(state):
                calls.append(state)
                raise OSError("no space left")

            drone.listen(raise_disk_full)
            with pytest.raises(LinkError, match="no space left"):
                await read_states(drone, 0.1)
            assert len(calls) == 1

    run(fly())


def test_a_flight_ends_when_the_drone_has_dropped_its_client():
    async def fly():
        async with connected() as (emulated, drone):
            await drone.take_off()
            emulated.drone._bootstrap, emulated.drone._sequence = True, 0  # The drone restarts.
            with pytest.raises(LinkError, match="restarted its count"):
                await read_states(drone)
            emulated.drone._bootstrap = False

    run(fly())
