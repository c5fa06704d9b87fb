"""The emulated AR.Drone 2.0 on sockets: other clients, killed clients, and the command."""

import asyncio
import importlib.util
import json
import os
import signal
import socket
import subprocess
import sys
import textwrap

import pytest
from deadtime import DeadtimeError, links as dtl
from deadtime._base.errors import LinkError
from deadtime._cli.emulate import print_address
from deadtime.links.ardrone2.commands import Config, Control, Move, Ref, Watchdog, encode
from deadtime.links.ardrone2.configuration import parse_configuration
from deadtime.links.ardrone2.emulator import Emulator, EmulatorOptions, Phase
from deadtime.links.ardrone2.navdata import parse_navdata
from hypothesis import given, settings, strategies as st

FREE = {"navdata_port": 0, "command_port": 0, "control_port": 0}

PYARDRONE = """
    import json, sys, time
    from pyardrone import ARDrone, at

    host, commands, navdata = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    drone = ARDrone(host=host, at_port=commands, navdata_port=navdata)

    def until(ready, doing=lambda: None, patience=20.0):
        end = time.monotonic() + patience
        while not ready():
            if time.monotonic() > end:
                raise TimeoutError(drone.navdata)
            doing()
            time.sleep(0.02)

    def height():
        return drone.navdata.demo.altitude

    try:
        assert drone.navdata_ready.wait(5)
        bootstrap = drone.state.navdata_bootstrap
        drone.send(at.CONFIG('general:navdata_demo', 'TRUE'))
        until(lambda: hasattr(drone.navdata, 'demo'))
        drone.takeoff()
        until(lambda: drone.state.fly_mask and drone.navdata.demo.ctrl_state >> 16 in (3, 4))
        hovering = height()
        drone.send(at.CTRL(5, 0))
        until(lambda: height() > hovering + 150, lambda: drone.move(up=0.5))
        climbed = height()
        drone.hover()
        time.sleep(1.0)
        stopped = height()
        drone.move(up=0.3)  # once
        time.sleep(2.0)
        on_one_command = height() - stopped
        drone.hover()
        drone.land()
        until(lambda: not drone.state.fly_mask)
        found = dict(bootstrap=bool(bootstrap), hovering=hovering, climbed=climbed, landed=height())
        found |= dict(on_one_command=on_one_command)
        print(json.dumps(found), flush=True)
    finally:
        drone.close()
"""

# It imports sockets only, so that it starts at once; it never lands.
RECKLESS = """
    import socket, sys, time

    commands = (sys.argv[1], int(sys.argv[2]))
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    number, begun = 1, time.monotonic()
    while True:
        gaz = 1056964608 if time.monotonic() - begun > 5.0 else 0
        text = f"AT*REF={number},290718208\\rAT*PCMD={number + 1},1,0,0,{gaz},0\\r"
        line.sendto(text.encode(), commands)
        number += 2
        time.sleep(0.03)
"""


async def client(script, emulator):
    return await asyncio.create_subprocess_exec(
        sys.executable,
        "-c",
        textwrap.dedent(script),
        emulator.host,
        str(emulator.command_port),
        str(emulator.navdata_port),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )


async def until(ready, patience=30.0):
    async with asyncio.timeout(patience):
        while not ready():
            await asyncio.sleep(0.005)


async def fly_pyardrone():
    async with Emulator(EmulatorOptions(**FREE)) as emulator:
        process = await client(PYARDRONE, emulator)
        out, errors = await asyncio.wait_for(process.communicate(), 60.0)
        return process.returncode, out.decode(), errors.decode(), emulator.truth()


async def kill_a_client():
    """Observations (time since the kill, truth) of the drone after its client was killed."""
    loop = asyncio.get_running_loop()
    async with Emulator(EmulatorOptions(**FREE)) as emulator:
        process = await client(RECKLESS, emulator)
        seen = []
        try:
            await until(lambda: emulator.truth().phase is Phase.FLYING)
            await until(lambda: emulator.truth().climb > 0.2)
        finally:
            process.kill()
            killed = loop.time()
            await process.wait()
        while not seen or seen[-1][1].phase is not Phase.LANDED:
            seen.append((loop.time() - killed, emulator.truth()))
            assert seen[-1][0] < 30.0
            await asyncio.sleep(0.01)
        return seen


@pytest.fixture(scope="module")
def both_flights():
    """Both flights in real time, at the same time to save time."""

    async def both():
        flights = [kill_a_client()]
        if importlib.util.find_spec("pyardrone") is not None:
            flights.append(fly_pyardrone())
        return await asyncio.gather(*flights)

    return asyncio.run(both())


def test_pyardrone_can_fly_the_emulator(both_flights):
    pytest.importorskip("pyardrone", reason="pyardrone, the client to fly with, is not installed")
    status, out, errors, truth = both_flights[1]
    assert status == 0, errors
    found = json.loads(out)
    assert found["bootstrap"]
    assert found["hovering"] == pytest.approx(750, abs=40)  # Heights in navdata are in mm.
    assert found["climbed"] > found["hovering"] + 150
    assert found["on_one_command"] == pytest.approx(0.3 * 0.7 * 0.885 * 1.5 * 1000.0, rel=0.4)
    assert found["landed"] < 40
    assert truth.phase is Phase.LANDED
    assert not truth.emergency


def test_a_drone_whose_client_was_killed_lands(both_flights):
    seen = both_flights[0]
    assert seen[0][1].setpoint == pytest.approx(0.35)
    flying = [truth.setpoint for _, truth in seen if truth.phase is Phase.FLYING]
    assert flying == pytest.approx([0.35] * len(flying))  # It still follows its last command.
    # The latest time is that of a pilot in virtual time; a busy machine adds to it.
    assert min(late for late, truth in seen if truth.phase is Phase.LANDING) > 1.65
    assert seen[-1][1].phase is Phase.LANDED


# --- the same on sockets in memory and in virtual time ------------------------------------------


class Receiver(asyncio.DatagramProtocol):
    def __init__(self):
        self.received = []

    def datagram_received(self, data, addr):
        self.received.append((asyncio.get_running_loop().time(), data, addr))


async def sockets_of(emulator):
    """Open a socket to the navdata port and one to the command port."""
    loop, found = asyncio.get_running_loop(), []
    for port in (emulator.navdata_port, emulator.command_port):
        found.append(
            await loop.create_datagram_endpoint(Receiver, remote_addr=(emulator.host, port))
        )
    (navdata, heard), (commands, silent) = found
    return navdata, heard, commands, silent


def test_a_flight_in_virtual_time():
    async def fly():
        loop = asyncio.get_running_loop()
        async with Emulator(EmulatorOptions(noise=0.0, downlink=0.02, **FREE)) as emulator:
            navdata, heard, commands, silent = await sockets_of(emulator)
            navdata.sendto(b"\x01")
            commands.sendto(encode([Config("general:navdata_demo", "FALSE")], 1))
            number = 2
            while loop.time() < 8.0:
                gaz = 0.5 if loop.time() > 6.0 else 0.0
                commands.sendto(encode([Control(5), Ref(take_off=True), Move(gaz=gaz)], number))
                number += 3
                await asyncio.sleep(0.03)
            await asyncio.sleep(10.0)
            assert silent.received == []  # Commands are never answered.
            navdata.close()
            commands.close()
            return heard.received, emulator.truth()

    received, truth = dtl.run(fly())
    assert truth.phase is Phase.LANDED
    packets = [(time, parse_navdata(data)) for time, data, _ in received]
    assert packets[0][1].bootstrap
    late = [time - packet.clock for time, packet in packets[1:]]
    assert max(abs(one - 0.02) for one in late) < 1e-6
    heights = [packet.height for _, packet in packets[1:]]
    assert max(heights) > 1.2
    assert dtl.run(fly())[0] == received


def test_the_configuration_is_read_over_tcp():
    async def read():
        found = []
        async with Emulator(EmulatorOptions(**FREE)) as emulator:
            _, _, commands, _ = await sockets_of(emulator)
            address = (emulator.host, emulator.control_port)
            reader, writer = await asyncio.open_connection(*address)
            commands.sendto(encode([Config("control:control_vz_max", "1000"), Control(4)], 1))
            found.append(await reader.readuntil(b"\0"))
            writer.close()
            commands.sendto(encode([Control(4)], 3))  # Some ask before they connect.
            await asyncio.sleep(0.1)
            reader, writer = await asyncio.open_connection(*address)
            found.append(await reader.readuntil(b"\0"))
            commands.sendto(encode([Control(6)], 4))
            found.append(await reader.readuntil(b"\0"))
            writer.close()
            commands.close()
        return found

    first, second, identifiers = dtl.run(read())
    assert float(parse_configuration(first)["control:control_vz_max"]) == 1000.0
    assert second == first
    assert set(parse_configuration(identifiers)) == {
        "custom:session_id",
        "custom:profile_id",
        "custom:application_id",
    }


def test_the_number_of_connections_is_limited():
    async def connect():
        async with Emulator(EmulatorOptions(**FREE)) as emulator:
            connections = []
            for _ in range(6):
                connections.append(
                    await asyncio.open_connection(emulator.host, emulator.control_port)
                )
            await asyncio.sleep(0.1)
            _, _, commands, _ = await sockets_of(emulator)
            commands.sendto(encode([Control(4)], 1))
            await asyncio.sleep(0.1)
            received = []
            for reader, writer in connections:
                writer.close()
                try:
                    received.append(await asyncio.wait_for(reader.read(1), 1.0))
                except (TimeoutError, ConnectionError):
                    received.append(b"")
            commands.close()
            return sum(map(bool, received))

    assert dtl.run(connect()) == 4


# --- on real sockets -------------------------------------------------------------------------


def test_an_occupied_port_is_named_in_the_error():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]

        async def open_it():
            async with Emulator(EmulatorOptions(**(FREE | {"command_port": port}))):
                pass

        with pytest.raises(LinkError, match=str(port)) as found:
            asyncio.run(open_it())
        assert isinstance(found.value, DeadtimeError)


def test_it_listens_on_an_ipv6_address_and_accepts_any_spelling_of_a_client():
    called = "::1"

    async def read():
        loop = asyncio.get_running_loop()
        options = EmulatorOptions(host=called, clients=("0:0::1",), **FREE)
        async with Emulator(options) as emulator:
            addresses = (called, emulator.navdata_port), (called, emulator.command_port)
            line, heard = await loop.create_datagram_endpoint(Receiver, remote_addr=addresses[0])
            commands, _ = await loop.create_datagram_endpoint(Receiver, remote_addr=addresses[1])
            line.sendto(b"\x01")
            await until(lambda: heard.received)
            reader, writer = await asyncio.open_connection(called, emulator.control_port)
            commands.sendto(encode([Control(4)], 1))
            dump = await asyncio.wait_for(reader.readuntil(b"\0"), 30.0)
            for end in (line, commands, writer):
                end.close()
            await writer.wait_closed()
            return heard.received[0][1], dump

    try:
        packet, dump = asyncio.run(read())
    except LinkError as error:
        pytest.skip(f"this machine has no IPv6: {error}")
    assert parse_navdata(packet).bootstrap
    assert "general:navdata_demo" in parse_configuration(dump)


@settings(max_examples=5)
@given(st.lists(st.tuples(st.integers(0, 2), st.binary(max_size=1400)), max_size=40))
def test_arbitrary_bytes_on_all_ports_leave_it_working(datagrams):
    async def throw():
        async with Emulator(EmulatorOptions(**FREE)) as emulator:
            navdata, heard, commands, _ = await sockets_of(emulator)
            _, stream = await asyncio.open_connection(emulator.host, emulator.control_port)
            for port, datagram in datagrams:
                if port == 2:
                    stream.write(datagram)
                else:
                    (navdata, commands)[port].sendto(datagram)
            await asyncio.sleep(0.02)
            # No handshake was completed: at most one packet of 24 bytes answers each datagram.
            assert len(heard.received) <= len(datagrams)
            assert all(len(data) == 24 for _, data, _ in heard.received)
            navdata.sendto(b"\x01\x00\x00\x00")
            commands.sendto(encode([Config("general:navdata_demo", "TRUE"), Watchdog()], 1))
            await until(lambda: heard.received and len(heard.received[-1][1]) == 500)
            for transport in (navdata, commands, stream):
                transport.close()
            await stream.wait_closed()

    asyncio.run(throw())


# --- the command -----------------------------------------------------------------------------


def started(*arguments, **others):
    return subprocess.Popen(
        [sys.executable, "-m", "deadtime", "emulate", "ardrone2", "--port-base", "0", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **others,
    )


def test_the_command_prints_its_ports_and_ends_when_its_input_ends(tmp_path):
    truth = tmp_path / "truth.csv"
    given = ("--json", "--until-input-ends", "--plant", "real", "--record", str(truth))
    with started(*given, stdin=subprocess.PIPE) as process:
        printed = json.loads(process.stdout.readline())
        assert printed["plant"] == "real"
        assert printed["delay"] == 0.34
        assert printed["worst_case"] is True
        with socket.create_connection((printed["host"], printed["ftp_port"]), 20.0) as files:
            assert files.recv(100).startswith(b"421 ")
        socket.create_connection((printed["host"], printed["video_port"]), 20.0).close()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.settimeout(20.0)
            line.sendto(b"\x01", (printed["host"], printed["navdata_port"]))
            assert parse_navdata(line.recv(4096)).bootstrap
        process.stdin.close()
        assert process.wait(20.0) == 0
        assert process.stderr.read() == ""
    lines = truth.read_text().splitlines()
    assert lines[0].startswith("time_s,height_m,climb_m_s,setpoint_m_s")
    assert len(lines) > 1


@pytest.mark.parametrize("end", ["time", "Ctrl-C"])
def test_the_command_may_end_before_its_input(end, listens_to_ctrl_c):
    given = ("--json", "--until-input-ends", *(["--duration", "0.1"] if end == "time" else []))
    with started(*given, "--forgiving", stdin=subprocess.PIPE) as process:
        assert json.loads(process.stdout.readline())["worst_case"] is False
        if end == "Ctrl-C":
            process.send_signal(signal.SIGINT)
        assert process.wait(20.0) == (130 if end == "Ctrl-C" else 0)
        errors = process.stderr.read()
    assert errors == ("deadtime: interrupted\n" if end == "Ctrl-C" else "")


def test_the_command_ends_at_once_without_input():
    with started("--json", "--until-input-ends", preexec_fn=lambda: os.close(0)) as process:
        assert process.wait(20.0) == 0
        assert process.stderr.read() == ""


def test_ctrl_c_ends_the_command(listens_to_ctrl_c):
    with started() as process:
        assert "Ctrl-C ends the emulator" in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait(20.0) == 130
        assert process.stderr.read() == "deadtime: interrupted\n"


def test_an_address_that_other_machines_reach_causes_a_warning(capsys):
    # The port is not opened, because tests stay on this machine.
    emulator = Emulator(EmulatorOptions(host="0.0.0.0", clients=("192.168.1.2",)))
    print_address(emulator, as_json=True)
    out, errors = capsys.readouterr()
    assert "no authentication" in errors
    assert json.loads(out)["host"] == "0.0.0.0"
    print_address(Emulator(EmulatorOptions()), as_json=True)
    assert capsys.readouterr().err == ""
