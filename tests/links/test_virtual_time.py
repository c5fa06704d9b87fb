"""Virtual time: the clock jumps, the network is in memory, and every run is deterministic."""

import asyncio
import math

import pytest
from deadtime import LinkError
from deadtime.links import run
from hypothesis import given, strategies as st


class Collector(asyncio.DatagramProtocol):
    def __init__(self):
        self.got, self.errors, self.lost = [], [], 0

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, address):
        self.got.append((asyncio.get_running_loop().time(), data, address))

    def error_received(self, error):
        self.errors.append(error)

    def connection_lost(self, error):
        self.lost += 1


@given(st.lists(st.floats(0.0, 1e4), min_size=1, max_size=20))
def test_sleeping_tasks_wake_in_order_and_at_their_times(delays):
    async def main():
        loop, woken = asyncio.get_running_loop(), []

        async def sleeper(delay):
            await asyncio.sleep(delay)
            woken.append((delay, loop.time()))

        await asyncio.gather(*(sleeper(delay) for delay in delays))
        return woken

    woken = run(main())
    # A loop may wake every task that is due within its clock's resolution of a nanosecond.
    assert all(abs(at - delay) <= 2e-9 for delay, at in woken)
    assert [delay for delay, _ in woken] == pytest.approx(sorted(delays), abs=2e-9)


def test_time_begins_at_zero_and_stands_still_while_the_program_computes():
    async def main():
        loop = asyncio.get_running_loop()
        first = loop.time()
        sum(range(10**5))
        return first, loop.time()

    assert run(main()) == (0.0, 0.0)


def test_timeouts_are_those_of_asyncio():
    async def main():
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(asyncio.Event().wait(), 7.5)
        return asyncio.get_running_loop().time()

    assert run(main()) == pytest.approx(7.5, abs=1e-8)


def test_a_wait_without_end_raises_instead_of_hanging():
    async def main():
        await asyncio.get_running_loop().create_future()

    with pytest.raises(LinkError, match="would never end"):
        run(main())


def test_a_sleep_of_infinite_length_is_not_jumped_to():
    with pytest.raises(LinkError, match="would never end"):
        run(asyncio.sleep(math.inf))

    async def main():
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(asyncio.sleep(math.inf), 5.0)
        return asyncio.get_running_loop().time()

    assert run(main()) == 5.0


def test_datagrams_arrive_at_once_in_order_with_their_sender():
    async def main():
        loop = asyncio.get_running_loop()
        there, sink = await loop.create_datagram_endpoint(Collector, local_addr=("127.0.0.1", 0))
        port = there.get_extra_info("sockname")[1]
        here, source = await loop.create_datagram_endpoint(
            Collector, remote_addr=("127.0.0.1", port)
        )
        for number in range(5):
            here.sendto(bytes([number]))
        await asyncio.sleep(1.0)
        there.sendto(b"back", here.get_extra_info("sockname"))
        await asyncio.sleep(1.0)
        return sink.got, source.got, here.get_extra_info("sockname")

    got, back, address = run(main())
    assert [(time, data) for time, data, _ in got] == [(0.0, bytes([n])) for n in range(5)]
    assert {sender for _, _, sender in got} == {address}
    assert [data for _, data, _ in back] == [b"back"]


def test_a_connected_endpoint_receives_its_peer_only_and_errors_if_it_is_absent():
    async def main():
        loop = asyncio.get_running_loop()
        peer, _ = await loop.create_datagram_endpoint(Collector, local_addr=("127.0.0.1", 5000))
        here, got = await loop.create_datagram_endpoint(
            Collector, local_addr=("127.0.0.1", 5001), remote_addr=("127.0.0.1", 5000)
        )
        stranger, _ = await loop.create_datagram_endpoint(Collector)
        stranger.sendto(b"forged", ("127.0.0.1", 5001))
        peer.sendto(b"true", ("127.0.0.1", 5001))
        await asyncio.sleep(0.1)
        peer.close()
        await asyncio.sleep(0.1)
        here.sendto(b"gone")
        await asyncio.sleep(0.1)
        with pytest.raises(OSError, match="in use"):
            await loop.create_datagram_endpoint(Collector, local_addr=("127.0.0.1", 5001))
        return got

    got = run(main())
    assert [data for _, data, _ in got.got] == [b"true"]
    assert [type(error) for error in got.errors] == [ConnectionRefusedError]


def test_streams_work_as_those_of_asyncio():
    async def main():
        async def shout(reader, writer):
            async for line in reader:
                writer.write(line.upper())
                await writer.drain()
            writer.close()

        server = await asyncio.start_server(shout, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"one\ntwo\n")
        writer.write_eof()
        text = await reader.read()
        writer.close()
        await writer.wait_closed()
        server.close()
        with pytest.raises(ConnectionRefusedError):
            await asyncio.open_connection("127.0.0.1", port)
        return text

    assert run(main()) == b"ONE\nTWO\n"


def test_ctrl_c_reaches_a_program_in_virtual_time(listens_to_ctrl_c):
    import signal

    async def main():
        asyncio.get_running_loop().call_later(10.0, signal.raise_signal, signal.SIGINT)
        try:
            while True:
                await asyncio.sleep(1.0)
        except asyncio.CancelledError:
            ended.append(asyncio.get_running_loop().time())
            raise

    ended = []
    with pytest.raises(KeyboardInterrupt):
        run(main())
    assert ended == [pytest.approx(10.0, abs=1.0)]
