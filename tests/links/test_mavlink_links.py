"""Several links to one vehicle, and a serial port, with the stand-in for an autopilot."""

import asyncio
import os
import warnings
from itertools import pairwise

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from deadtime import FlightAbortedError, LinkError
from deadtime.links import Limits, run
from deadtime.links.mavlink import LinkAddress, MAVLinkVehicle
from deadtime.links.mavlink.states import wanted_messages
from stand_in_autopilot import StandIn, told

FIRST, SECOND = ("127.0.0.1", 14550), ("127.0.0.1", 14551)
BOTH = "udp:127.0.0.1:14550,udp:127.0.0.1:14551"
LIMITS = Limits(max_climb=1.0)


def test_addresses_of_serial_ports_and_of_several_links():
    assert LinkAddress.of("serial:/dev/ttyUSB0") == LinkAddress("serial", "/dev/ttyUSB0", 115200)
    assert str(LinkAddress.of("serial:COM3:57600")) == "serial:COM3:57600"
    # What is at the other end of a port is no program of this computer.
    assert not LinkAddress.of("serial:/dev/ttyUSB0").loopback
    assert [one.port for one in LinkAddress.all_of(BOTH)] == [14550, 14551]
    for wrong in ("serial:", "serial::57600", "serial:/dev/ttyUSB0:0", "udp:1,", "udp:x"):
        with pytest.raises(ValueError, match="serial:DEVICE:BAUD"):
            LinkAddress.all_of(wrong)
    with pytest.raises(ValueError, match="each link once"):
        LinkAddress.all_of("udp:14550,udp:127.0.0.1:14550")


def commanded(vehicle, since=0):
    """Over which links set points came."""
    return {ground for ground, kind in vehicle.came[since:] if kind.startswith("SET_POSITION")}


def test_a_flight_goes_on_over_another_link():
    async def flight():
        async with (
            StandIn(grounds=(FIRST, SECOND)) as vehicle,
            MAVLinkVehicle(BOTH, LIMITS) as link,
        ):
            # Each link is asked for its messages.
            asked = [ground for ground, kind in vehicle.came if kind == "COMMAND_LONG"]
            assert asked.count(FIRST) >= 7
            assert asked.count(SECOND) >= 7
            await link.take_off()
            await told(link, 0.3, 1.0)
            assert commanded(vehicle) == {FIRST}
            place = len(vehicle.came)
            vehicle.cut = {FIRST}
            with pytest.warns(RuntimeWarning) as said:
                states = await told(link, 0.3, 2.0)
            assert [str(one.message).partition(". ")[0] for one in said] == [
                "udp:127.0.0.1:14550: nothing has been received for 0.2 s"
            ]
            assert "over udp:127.0.0.1:14551" in str(said[0].message)
            assert commanded(vehicle, place) == {SECOND}
            # No state is too old for a flight, and no lost message is counted.
            ages = [after.time - before.time for before, after in pairwise(states)]
            assert max(ages) < LIMITS.max_state_age
            assert states[-1].missing == 0
            assert vehicle.climb == pytest.approx(0.3, abs=0.01)
            # The first one is back: what works stays in use.
            vehicle.cut, place = set(), len(vehicle.came)
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                await told(link, -0.3, 1.0)
            assert commanded(vehicle, place) == {SECOND}
            vehicle.cut = {SECOND}
            with pytest.warns(RuntimeWarning, match="over udp:127.0.0.1:14550"):
                await told(link, 0.0, 1.0)
            await link.land()
            assert not vehicle.armed

    run(flight())


def test_without_any_link_the_flight_ends_as_without_one():
    async def flight():
        async with StandIn(grounds=(FIRST, SECOND)) as vehicle:
            link = MAVLinkVehicle(BOTH, LIMITS)
            await link.connect()
            await link.take_off()
            vehicle.cut = {FIRST, SECOND}
            with pytest.raises(
                FlightAbortedError, match=r"nothing has been received from udp.*14551 for 1"
            ):
                await told(link, 0.2, 3.0)
            with pytest.raises(LinkError, match="lands by its own failsafe"):
                await link.close()
            await asyncio.sleep(5.0)
            assert not vehicle.armed

    run(flight())


def test_a_first_link_that_is_silent_from_the_beginning():
    async def connected():
        async with StandIn(grounds=(FIRST, SECOND)) as vehicle:
            vehicle.cut = {FIRST}
            async with MAVLinkVehicle(BOTH, LIMITS) as link:
                await link.state()
                assert link.link_time.median < 0.01

    with pytest.warns(RuntimeWarning, match="over udp:127.0.0.1:14551"):
        run(connected())


def test_links_to_two_vehicles_of_one_id_are_refused():
    async def connect():
        async with StandIn(ground=FIRST), StandIn(ground=SECOND) as other:
            other._begin -= 7.0
            await MAVLinkVehicle(BOTH, LIMITS).connect()

    with pytest.raises(LinkError, match=r"14551 and .*14550 have different clocks"):
        run(connect())


def test_another_vehicle_does_not_take_over():
    async def flight():
        async with StandIn(ground=FIRST) as vehicle, StandIn(ground=SECOND) as other:
            other._begin -= 7.0
            other.cut = {SECOND}
            link = MAVLinkVehicle(BOTH, LIMITS)
            await link.connect()
            await link.take_off()
            other.cut = set()
            await told(link, 0.1, 1.0)
            vehicle.cut = {FIRST}
            with pytest.raises(FlightAbortedError, match="nothing has been received"):
                await told(link, 0.1, 3.0)
            assert not other.set_points
            with pytest.raises(LinkError, match="lands by its own failsafe"):
                await link.close()

    with pytest.warns(RuntimeWarning, match=r"14551: nothing has been received for .* in reserve"):
        run(flight())


def test_a_silent_link_that_stands_by_is_named_once():
    async def connected():
        async with (
            StandIn(grounds=(FIRST, SECOND)) as vehicle,
            MAVLinkVehicle(BOTH, LIMITS),
        ):
            vehicle.cut = {SECOND}
            with pytest.warns(RuntimeWarning) as said:
                await asyncio.sleep(6.0)
            (one,) = said
            assert "14551: nothing has been received for 2.0 s. This link was in reserve" in str(
                one.message
            )

    run(connected())


def test_a_warning_that_is_an_error_does_not_keep_the_links_from_being_looked_at():
    async def flight():
        async with StandIn(grounds=(FIRST, SECOND)) as vehicle:
            link = MAVLinkVehicle(BOTH, LIMITS)
            await link.connect()
            await link.take_off()
            vehicle.cut = {FIRST}
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                await asyncio.sleep(0.28)
            with pytest.raises(LinkError, match="nothing has been received for"):
                await link.state()
            await link.close()
            assert not vehicle.armed

    run(flight())


def test_signed_frames_have_the_number_of_their_link():
    key = bytes(range(32))

    async def connected():
        async with (
            StandIn(grounds=(FIRST, SECOND), key=key),
            MAVLinkVehicle(BOTH, LIMITS, key=key) as link,
        ):
            await link.state()
            return [one.codec._mav.signing.link_id for one in link._link.carriers]

    assert run(connected()) == [0, 1]


def test_slow_serial_links_are_asked_for_fewer_messages():
    rates = [
        {name: rate for name, (_, rate) in wanted_messages("EKF_STATUS_REPORT", baud).items()}
        for baud in (None, 115_200, 57_600)
    ]
    assert rates[0] == rates[1]
    assert rates[2]["LOCAL_POSITION_NED"] == pytest.approx(28.8)
    assert rates[2]["HEARTBEAT"] == 10.0


@pytest.fixture
def terminals():
    """Both ends of a pseudo-terminal: a file, and the name of a serial port."""
    pytest.importorskip("serial", reason="pyserial opens ports")
    pty = pytest.importorskip("pty", reason="a system with pseudo-terminals")
    master, slave = pty.openpty()
    yield master, os.ttyname(slave)
    for one in (master, slave):
        os.close(one)


def test_a_vehicle_on_a_serial_port(terminals):
    master, name = terminals

    async def connected():
        async with StandIn(serial=master) as vehicle:
            async with MAVLinkVehicle(f"serial:{name}:57600", LIMITS, vehicle=1) as link:
                assert (await link.state()).landed
                assert await link.parameter("GUID_TIMEOUT") == 0.5
                assert vehicle.parameters["GUID_TIMEOUT"] == 0.5
                assert vehicle._intervals[32] == pytest.approx(1.0 / 28.8)
                with pytest.raises(LinkError, match="not in the air"):
                    link.command(0.1)
                await link._link.until(lambda: link.link_time is not None, 2.0)
                assert link.link_time.answers > 0
            assert vehicle.parameters["GUID_TIMEOUT"] == 3.0

    asyncio.run(connected())


def test_what_a_serial_port_does_not_take_is_lost(terminals):
    from deadtime.links.mavlink.serial_port import SerialPort

    master, name = terminals

    async def filled():
        port = SerialPort(name, 57600, lambda data: None)
        for _ in range(2000):  # nobody reads
            port.send(bytes(100))
        waiting = len(os.read(master, 1 << 20))
        port.close()
        port.send(b"nothing")
        return waiting

    assert 0 < asyncio.run(filled()) < 100_000


def test_ports_that_cannot_be_opened(tmp_path):
    pytest.importorskip("serial", reason="pyserial opens ports")

    async def connect(address):
        await MAVLinkVehicle(address).connect()

    with pytest.raises(LinkError, match="nowhere at 57600 baud cannot be opened"):
        asyncio.run(connect(f"serial:{tmp_path}/nowhere:57600"))
    # The links that were opened before are closed again.
    with pytest.raises(LinkError, match="nowhere at 115200 baud cannot be opened"):
        asyncio.run(connect(f"udp:127.0.0.1:45671,serial:{tmp_path}/nowhere"))
