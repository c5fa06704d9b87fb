"""Messages of other AR.Drone 2.0 clients, replayed to the emulator in virtual time.

python-ardrone (venthur) opens a socket for each command; ps_drone checks whether TCP port 21
answers and flies for seconds on one command; node-ar-drone waits for the acknowledgement of each
setting. The replays were written from what the clients send and contain none of their code.

"""

import asyncio
import itertools
from contextlib import AsyncExitStack, asynccontextmanager

import pytest
from deadtime import links
from deadtime.links.ardrone2.configuration import parse_configuration
from deadtime.links.ardrone2.emulator import Emulator, EmulatorOptions, Phase
from deadtime.links.ardrone2.emulator.options import ports_from
from deadtime.links.ardrone2.navdata import parse_navdata

HOST = "127.0.0.1"
FREE = ports_from(0)


class Receiver(asyncio.DatagramProtocol):
    """A socket that keeps the navdata that it receives."""

    def __init__(self):
        self.heard = []

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, addr):
        self.heard.append((asyncio.get_running_loop().time(), parse_navdata(data)))


async def open_receiver(port):
    loop = asyncio.get_running_loop()
    _, listening = await loop.create_datagram_endpoint(Receiver, remote_addr=(HOST, port))
    return listening


@asynccontextmanager
async def connection(port):
    """Return what a connection receives without a request."""
    reader, writer = await asyncio.open_connection(HOST, port)
    try:
        yield reader
    finally:
        writer.close()


async def has_ended(reader):
    """Read a connection and return whether it is closed."""
    try:
        async with asyncio.timeout(0.01):
            while await reader.read(65536):
                pass
    except TimeoutError:
        return False
    return True


class Client:
    """Number commands and send each in a datagram, from one socket or from a new one each."""

    def __init__(self, emulator, first=1, *, one_socket=True):
        self.port, self.number, self.one_socket = emulator.command_port, first, one_socket
        self.line, self.last = None, 0.0
        self.clock = asyncio.get_running_loop().time

    async def at(self, name, *arguments):
        if self.line is None or not self.one_socket:
            self.line = await open_receiver(self.port)
        text = "".join(f",{argument}" for argument in arguments)
        self.line.transport.sendto(f"AT*{name}={self.number}{text}\r".encode())
        self.number, self.last = self.number + 1, self.clock()
        if not self.one_socket:
            self.line.transport.close()

    async def config(self, key, value):
        await self.at("CONFIG", f'"{key}"', f'"{value}"')

    async def sleep(self, duration, every):
        """Wait, and keep the link alive with COMWDG whenever nothing has been sent for a while."""
        end = self.clock() + duration
        while self.clock() < end:
            await asyncio.sleep(min(0.01, end - self.clock()))
            if self.clock() - self.last >= every:
                await self.at("COMWDG")


async def settings_of(emulator, client):
    """Return the configuration as read by a connection that was opened before the request."""
    async with connection(emulator.control_port) as reader:
        await client.at("CTRL", 4, 0)
        return parse_configuration(await reader.readuntil(b"\0"))


IDS = ('"943dac23"', '"36355d78"', '"21d958e4"')

#: In the client's order, with pauses of half a second; the client misspells the first video key.
SETTINGS_OF_PYTHON_ARDRONE = [
    ("custom:session_id", "943dac23"),
    ("custom:profile_id", "36355d78"),
    ("custom:application_id", "21d958e4"),
    ("video:bitrate_control_mode", "1"),
    ("video:bitrate", "10000"),
    ("video:max_bitrate", "10000"),
    ("video:codec_fps", "30"),
    ("video:video_codec", "129"),
]


async def fly_python_ardrone():
    async with AsyncExitStack() as stack:
        emulator = await stack.enter_async_context(Emulator(EmulatorOptions(noise=0.0, **FREE)))
        client = Client(emulator, one_socket=False)
        await client.config("general:navdata_demo", "TRUE")
        for key, value in SETTINGS_OF_PYTHON_ARDRONE[:3]:
            await client.config(key, value)
        await client.at("CONFIG_IDS", *IDS)
        await client.config("general:navdata_demo", "TRUE")
        for key, value in SETTINGS_OF_PYTHON_ARDRONE:
            await client.at("CONFIG_IDS", *IDS)
            await client.config(key, value)
            await client.sleep(0.5, every=0.2)
        video = await stack.enter_async_context(connection(emulator.video_port))
        navdata = await open_receiver(emulator.navdata_port)
        navdata.transport.sendto(b"\x01\x00\x00\x00")  # Navdata are requested once only.
        control = await stack.enter_async_context(connection(emulator.control_port))
        begun = client.clock()
        await client.at("REF", 290718208)
        await client.sleep(6.0, every=0.2)
        hovering = emulator.truth()
        await client.at("PCMD", 1, 0, 0, 1045220557, 0)  # Climb at 0.2, sent once.
        await client.sleep(2.0, every=0.2)
        climbed = emulator.truth()
        await client.at("PCMD", 0, 0, 0, 0, 0)
        await client.sleep(12.0, every=0.2)
        flying = emulator.truth()
        await client.at("REF", 290717696)
        await client.sleep(8.0, every=0.2)
        assert not await has_ended(video)  # The client never stops reading a closed stream.
        assert not await has_ended(control)
        settings = await settings_of(emulator, client)
        states = (hovering, climbed, flying, emulator.truth())
        return states, settings, [t - begun for t, _ in navdata.heard], navdata.heard[-1][1]


def test_python_ardrone_keeps_receiving_navdata_with_a_new_socket_for_each_command():
    states, settings, times, last = links.run(fly_python_ardrone())
    assert max(b - a for a, b in itertools.pairwise(times)) < 0.1
    assert times[-1] > 27.9
    hovering, climbed, flying, landed = states
    assert climbed.height - hovering.height == pytest.approx(0.2 * 0.7 * 2.0 * 0.885, rel=0.3)
    assert flying.phase is Phase.FLYING
    assert flying.climb == pytest.approx(0.0, abs=1e-6)
    assert (landed.phase, last.demo.major, last.flying) == (Phase.LANDED, 2, False)
    for key, value in SETTINGS_OF_PYTHON_ARDRONE:
        assert settings.get(key) == (None if key == "video:bitrate_control_mode" else value)


async def fly_ps_drone():
    async with AsyncExitStack() as stack:
        emulator = await stack.enter_async_context(Emulator(EmulatorOptions(noise=0.0, **FREE)))
        async with connection(emulator.ftp_port) as files:  # The client checks this port.
            answer = await files.read()
        client = Client(emulator, first=3)
        line = client.line = await open_receiver(emulator.command_port)
        for raw in (b"\r", b"AT*PMODE=1,2\rAT*MISC=2,2,20,2000,3000\r"):
            line.transport.sendto(raw)
            await asyncio.sleep(0.01)
        navdata = await open_receiver(emulator.navdata_port)
        navdata.transport.sendto(b"\x01\x00\x00\x00")
        reader = await stack.enter_async_context(connection(emulator.control_port))  # stays open
        await asyncio.sleep(0.1)
        for key, value in (("general:navdata_demo", "TRUE"), ("custom:session_id", "-all")):
            await client.config(key, value)
            # The client waits for the bit and then for its reset, without a time-out.
            for requested in (True, False):
                async with asyncio.timeout(2.0):
                    while navdata.heard[-1][1].command_acknowledged is not requested:
                        await client.sleep(0.001, every=0.1)
                if requested:
                    await client.at("CTRL", 5, 0)
        await client.at("CTRL", 5, 0)
        await client.at("CTRL", 4, 0)
        settings = parse_configuration(await reader.readuntil(b"\0"))
        await client.at("REF", 290718208)
        await client.sleep(7.5, every=0.1)
        begun = emulator.truth()
        await client.at("PCMD", 3, 0, -2147483648, 1045220557, 0)  # moveUp, once: flag 3 and -0.0
        await client.sleep(2.0, every=0.1)
        await client.at("PCMD", 0, 0, 0, 0, 0)
        await client.sleep(2.0, every=0.1)
        flown = emulator.truth()
        await client.at("REF", 290717696)
        await client.sleep(6.0, every=0.1)
        return answer, settings, begun, flown, emulator.truth()


def test_ps_drone_starts_and_flies_on_one_command_for_two_seconds():
    """ps_drone needs an answer on TCP port 21, and `moveUp` is a single command."""
    answer, settings, begun, flown, landed = links.run(fly_ps_drone())
    assert answer.startswith(b"421 ")
    assert settings["general:navdata_demo"] == "TRUE"
    assert flown.height - begun.height == pytest.approx(0.2 * 0.7 * 2.0 * 0.885, rel=0.02)
    assert landed.phase is Phase.LANDED


#: Settings of programs that use node-ar-drone.
SETTINGS_OF_NODE = {
    "general:navdata_demo": "FALSE",
    "general:navdata_options": "105971713",
    "video:video_channel": "1",
    "detect:detect_type": "12",
    "control:altitude_max": "2700",
    "control:flight_anim": "16,5",
    "leds:leds_anim": "0,1084227584,2",
    "network:owner_mac": "00:11:22:33:44:55",
    "userbox:userbox_cmd": "0",
    "gps:latitude": "4631107791820423168",
    "pic:ultrasound_freq": "7",
}


async def configure_by_node(keys):
    """Send each setting; return whether it was acknowledged and how long that took, s."""
    async with Emulator(EmulatorOptions(noise=0.0, **FREE)) as emulator:
        client, navdata = Client(emulator, first=0), await open_receiver(emulator.navdata_port)
        navdata.transport.sendto(b"\x01")
        found = {}
        for key, value in keys.items():
            await client.config(key, value)
            begun = client.clock()
            while client.clock() - begun < 0.5:  # The client's own time-out.
                await client.at("REF", 0)
                await client.at("PCMD", 0, 0, 0, 0, 0)
                await asyncio.sleep(0.03)
                if navdata.heard and navdata.heard[-1][1].command_acknowledged:
                    break
            found[key] = (navdata.heard[-1][1].command_acknowledged, client.clock() - begun)
            while navdata.heard[-1][1].command_acknowledged:
                await client.at("CTRL", 5, 0)
                await asyncio.sleep(0.05)
        return found, await settings_of(emulator, client)


def test_node_ar_drone_has_each_of_its_settings_acknowledged_at_once():
    """The client waits 0.6 s for an acknowledgement and then raises an error."""
    found, settings = links.run(configure_by_node(SETTINGS_OF_NODE))
    for key, value in SETTINGS_OF_NODE.items():
        acknowledged, after = found[key]
        assert acknowledged, key
        assert after < 0.1, key
        assert settings[key] == value
    found, _ = links.run(configure_by_node({"general:navdata_demo": "TRUE", "video:codec": "1"}))
    assert found["video:codec"][0] is False  # The drone has no such key.


async def idle_connections(port_name, host_speaks):
    """How many of ten idle connections stay open at once, and the answer to one more."""
    async with AsyncExitStack() as stack:
        emulator = await stack.enter_async_context(Emulator(EmulatorOptions(**FREE)))
        client = Client(emulator)
        port = getattr(emulator, port_name)
        kept = [await stack.enter_async_context(connection(port)) for _ in range(10)]
        await asyncio.sleep(0.1)
        open_connections = 10 - sum([await has_ended(reader) for reader in kept])
        settings = await settings_of(emulator, client)
        for _ in range(60):
            await asyncio.sleep(1.0)
            if host_speaks:
                await client.at("COMWDG")
        left = 10 - sum([await has_ended(reader) for reader in kept])
        return open_connections, settings, left


@pytest.mark.parametrize("host_speaks", [True, False])
@pytest.mark.parametrize("port_name", ["control_port", "video_port"])
def test_idle_connections_are_limited_time_out_and_block_nobody(port_name, host_speaks):
    """Four idle connections must not keep other clients from the configuration."""
    open_connections, settings, left = links.run(idle_connections(port_name, host_speaks))
    assert open_connections == 4
    assert "control:altitude_max" in settings
    assert left == ((3 if port_name == "control_port" else 4) if host_speaks else 0)


def test_a_connection_in_use_is_not_the_one_that_is_closed():
    async def open_many():
        async with AsyncExitStack() as stack:
            emulator = await stack.enter_async_context(Emulator(EmulatorOptions(**FREE)))
            client = Client(emulator)
            kept = await stack.enter_async_context(connection(emulator.control_port))
            found = []
            for _ in range(3):
                await client.at("CTRL", 4, 0)
                found.append(parse_configuration(await kept.readuntil(b"\0")))
                for _ in range(10):
                    await stack.enter_async_context(connection(emulator.control_port))
            return found

    first, *others = links.run(open_many())
    assert others == [first, first]
