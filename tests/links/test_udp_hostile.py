"""Packets with impossible contents from the peer's own address: the run ends with a true report."""

import asyncio
import ipaddress
import json
import math
import socket
import struct

import pytest
from deadtime._base.plain import plain
from deadtime.links import virtual_time
from deadtime.links.addresses import canonical
from deadtime.links.udp import (
    Controller,
    ControllerOptions,
    LoopPacket,
    PlantOptions,
    Relay,
    RelayOptions,
    run_plant,
)
from hypothesis import example, given, settings, strategies as st

FIELDS = ("flags", "sequence", "echo_sequence", "sent", "echo_sent", "held", "value", "reference")
LIMIT, DURATION = 5.0, 0.4

NUMBERS = st.one_of(
    st.floats(),
    st.sampled_from([math.nan, math.inf, -math.inf, 1.7e308, -1.7e308, 1e308, -1e308, 1e10, -0.5]),
)
WORDS = st.one_of(st.integers(0, 2**32 - 1), st.sampled_from([0, 1, 2**31, 2**32 - 1]))
CHANGE = st.fixed_dictionaries(
    {},
    optional={
        name: WORDS if name in ("flags", "sequence", "echo_sequence") else NUMBERS
        for name in FIELDS
    },
)
CHANGES = st.lists(CHANGE, min_size=1, max_size=8)


def raw(packet, change):
    """Encode a packet with fields changed, including values that `LoopPacket.encode` refuses."""
    words = vars(packet) | change
    return struct.pack("<4sIIIddddd", b"DTL1", *(words[name] for name in FIELDS))


class Peer(asyncio.DatagramProtocol):
    """The other end of the link: it keeps what it receives."""

    def __init__(self):
        self.received = []

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, addr):
        self.received.append(LoopPacket.decode(data))


async def other_end(port=0):
    loop = asyncio.get_running_loop()
    _, other = await loop.create_datagram_endpoint(Peer, local_addr=("127.0.0.1", port))
    return loop, other


async def controller_among(changes):
    """Report of a controller whose plant sends true packets with changed ones between them."""
    loop, plant = await other_end()
    async with Controller(ControllerOptions(gain=4.0, limit=LIMIT)) as controller:
        number = 0
        while loop.time() < DURATION:
            number += 1
            last = plant.received[-1] if plant.received else LoopPacket(0, 0.0)
            true = LoopPacket(number, 100.0 + loop.time(), last.sequence, last.sent, 0.0, 0.5, 1.0)
            for change in changes if number in (3, 30) else ():
                plant.transport.sendto(raw(true, change), controller.address)
            plant.transport.sendto(true.encode(), controller.address)
            await asyncio.sleep(0.01)
        report = controller.report()
    plant.transport.close()
    return report, plant.received


async def plant_among(changes):
    """Report of a plant whose controller sends true answers with changed ones between them."""
    loop, controller = await other_end(41_000)
    options = PlantOptions(
        controller=("127.0.0.1", 41_000),
        listen=("127.0.0.1", 40_000),
        duration=DURATION,
        limit=LIMIT,
    )
    plant, number = asyncio.ensure_future(run_plant(options)), 0
    while not plant.done():
        await asyncio.sleep(0.01)
        if not controller.received:
            continue
        number += 1
        last = controller.received[-1]
        true = LoopPacket(number, loop.time() - 50.0, last.sequence, last.sent, 0.0, 0.5, 1.0)
        controller.transport.sendto(true.encode(), options.listen)
        for change in changes if number in (3, 30) else ():
            controller.transport.sendto(raw(true, change), options.listen)
    controller.transport.close()
    return plant.result(), controller.received


def check(report, received):
    """Check what holds of every report and of all that is sent, whatever the peer sent."""
    json.dumps(plain(report.to_dict()), allow_nan=False)
    link = report.link
    assert link.round_trip.count > 0
    assert 0.0 <= link.round_trip.p50 <= link.round_trip.largest <= DURATION
    assert all(math.isfinite(edge) for edge in link.round_trip_histogram[0])
    assert all(
        math.isfinite(bound) for bound in (*link.forward_delay, *link.return_delay, link.jitter)
    )
    assert 0.0 <= report.largest_command <= LIMIT
    assert all(math.isfinite(packet.value) for packet in received)


@given(CHANGES)
@example([{"echo_sent": -1e308}])  # must not end the controller
@example([{"sent": 1e308}, {"sent": -1e308}])  # The sum of the two delays is not finite.
@example([{"value": 1.7e308, "reference": -1.7e308}])
@settings(max_examples=30)
def test_no_packet_of_its_plant_ends_a_controller_without_a_report(changes):
    report, received = virtual_time.run(controller_among(changes))
    check(report, received)
    assert all(abs(packet.value) <= LIMIT for packet in received)
    assert report.answered > 0


@given(CHANGES)
@example([{"held": 1e308}])
@example([{"sent": 1e308}, {"sent": -1e308}])
@settings(max_examples=30)
def test_no_packet_of_its_controller_ends_a_plant_without_a_report(changes):
    report, received = virtual_time.run(plant_among(changes))
    check(report, received)
    assert abs(report.recording.command).max() <= LIMIT
    assert math.isfinite(report.age)


@pytest.mark.parametrize(
    "change",
    [
        {"echo_sent": -1e308},
        {"echo_sent": 0.0},  # Not the time at which that packet was sent.
        {"echo_sequence": 4_000_000},  # It was never sent.
        {"echo_sent": 1e9},  # It has not been sent yet.
        {"held": 3.0},  # The hold is longer than the round trip.
    ],
)
def test_a_controller_rejects_every_echo_that_a_plant_would_reject(change):
    """Times in a packet that answers nothing the controller sent are not measured."""
    true, _ = virtual_time.run(controller_among([]))
    report, _ = virtual_time.run(controller_among([change]))
    # The true packet with the same number arrives after it and counts as a duplicate.
    assert report.link.round_trip.count == true.link.round_trip.count - 2
    assert report.link.round_trip.largest == pytest.approx(true.link.round_trip.largest, abs=1e-9)
    assert report.link.forward_delay == pytest.approx(true.link.forward_delay, abs=1e-9)
    assert (
        report.answered == true.answered
    )  # The measurement in it is used, because the plant may have restarted.


# --- addresses ---------------------------------------------------------------------------------


@given(st.ip_addresses(v=6))
def test_all_spellings_of_an_address_compare_equal(address):
    if address.ipv4_mapped is None:
        assert canonical(address.exploded) == canonical(str(address)) == str(address)
        assert canonical(address.exploded.upper()) == str(address)


@given(st.ip_addresses(v=4))
def test_an_ipv4_address_reported_by_an_ipv6_socket_is_the_ipv4_address(address):
    assert canonical(str(address)) == str(address)
    assert canonical(f"::ffff:{address}") == str(address)
    assert canonical(ipaddress.IPv6Address(f"::ffff:{address}").exploded) == str(address)


def test_the_scope_of_an_address_is_compared_by_its_number():
    ((number, name), *_) = socket.if_nameindex()
    assert canonical(f"fe80:0::1%{name}") == canonical(f"fe80::1%{number}") == f"fe80::1%{number}"
    assert canonical("fe80::1%77") != canonical("fe80::1%78")
    assert canonical("plant.local") == "plant.local"


def step(controller_host, listen="::1", plant=None):
    """Report of a plant that looks for its controller at a host in this spelling."""

    async def run():
        options = ControllerOptions(gain=4.0, listen=(listen, 0), plant=plant)
        async with Controller(options) as controller:
            controller_address = (controller_host, controller.address[1])
            options = PlantOptions(
                controller=controller_address, listen=("::1", 0), duration=0.6, rest=0.0
            )
            report = await run_plant(options)
            return report, controller.report()

    return run()


def test_an_ipv6_address_may_be_spelled_in_any_way():
    """With ``[0::1]`` the answers must not count as those of a foreign host."""
    plant, controller = virtual_time.run(step("0::1"))
    assert (plant.link.foreign, controller.link.foreign) == (0, 0)
    assert plant.applied > 30


def with_ipv6():
    try:
        with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as line:
            line.bind(("::1", 0))
    except OSError:
        pytest.skip("this machine has no IPv6")


def test_ipv6_addresses_on_real_sockets():
    with_ipv6()
    plant, _ = asyncio.run(step("0:0:0:0:0:0:0:1"))
    assert plant.link.foreign == 0
    assert plant.applied > 0


def test_a_controller_on_a_socket_of_ipv6_answers_a_plant_of_ipv4():
    with_ipv6()

    async def run():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        listen = ("::ffff:127.0.0.1", 0)  # IPv6, but reachable from this machine only
        options = ControllerOptions(gain=4.0, listen=listen, plant=("127.0.0.1", port))
        async with Controller(options) as controller:
            controller_address = ("127.0.0.1", controller.address[1])
            async with Relay(RelayOptions(("::ffff:127.0.0.1", controller_address[1]))) as relay:
                assert relay.address[0] == "127.0.0.1"
            plant = PlantOptions(
                controller=controller_address, listen=("127.0.0.1", port), duration=0.6, rest=0.0
            )
            return await run_plant(plant)

    report = asyncio.run(run())
    assert report.link.foreign == 0
    assert report.applied > 0
