"""What a run has changed in a vehicle outlives it on disk, and goes back in the next one."""

import asyncio
import json
import math

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from deadtime import LinkError
from deadtime.links import Limits, run
from deadtime.links.mavlink import MAVLinkVehicle
from stand_in_autopilot import StandIn, told

ADDRESS = "udp:127.0.0.1:14550"
LIMITS = Limits(max_climb=1.0)
FIRMWARES = ["ardupilot", "px4"]


def kill(link):
    """End a link as `kill -9` does: nothing more is sent."""
    link._cycle.cancel()
    link._link.send = lambda message: None
    link._link.shut()
    link._authority.armed_at = math.inf


async def killed_in_flight(vehicle, folder=None):
    link = MAVLinkVehicle(ADDRESS, LIMITS, folder=folder)
    await link.connect()
    await link.take_off()
    await told(link, 0.1, 0.5)
    kill(link)
    while vehicle.armed:  # its own failsafe lands it
        await asyncio.sleep(0.5)


def files(folder):
    return sorted(path.name for path in folder.rglob("changed-parameters-*"))


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_the_run_after_a_killed_one_says_so_and_leaves_every_parameter_as_before(
    firmware, tmp_path
):
    """The second run took what the first had set for the vehicle's own, for good."""

    async def flights():
        async with StandIn(firmware) as vehicle:
            before = dict(vehicle.parameters)
            await killed_in_flight(vehicle)
            assert vehicle.parameters != before
            with pytest.warns(RuntimeWarning, match="was killed or lost its link") as said:
                async with MAVLinkVehicle(ADDRESS, LIMITS) as link:
                    await link.take_off()
            assert all(
                f"{name} = {value:g}" in str(said[0].message)
                for name, value in before.items()
                if files(tmp_path) and value != vehicle.parameters[name]
            )
            assert vehicle.parameters == before

    run(flights())
    assert files(tmp_path) == []


def test_old_values_are_on_disk_before_the_first_one_is_set(tmp_path):
    async def connected():
        async with StandIn() as vehicle:
            take, wanted, sent = vehicle._take_param_set, [], []

            def checked(message):
                (path,) = tmp_path.glob("changed-parameters-ArduPilot-1.json")
                kept = json.loads(path.read_text())["parameters"][message.param_id]
                wanted.append((kept["before"], kept["set"]))
                sent.append(message.param_value)
                take(message)

            vehicle._take_param_set = checked
            async with MAVLinkVehicle(ADDRESS, LIMITS):
                assert len(files(tmp_path)) == 1
                assert sent == pytest.approx([set_to for _, set_to in wanted])
                del sent[:], wanted[:]
            assert sent == [before for before, _ in wanted]

    run(connected())
    assert files(tmp_path) == []


def test_restore_puts_back_what_was_left_and_sets_nothing_else(tmp_path):
    async def flights():
        async with StandIn() as vehicle:
            before = dict(vehicle.parameters)
            await killed_in_flight(vehicle, tmp_path / "one" / "flight")
            assert files(tmp_path) == ["changed-parameters-ArduPilot-1.json"]
            (sentence,) = await MAVLinkVehicle(ADDRESS, folder=tmp_path / "one" / "two").restore()
            assert "FENCE_TYPE = 7" in sentence
            assert vehicle.parameters == before
            assert await MAVLinkVehicle(ADDRESS, folder=tmp_path / "one").restore() == []
            assert vehicle.parameters == before

    run(flights())
    assert files(tmp_path) == []


def test_what_somebody_has_changed_since_is_left_alone(tmp_path):
    async def flights():
        async with StandIn() as vehicle:
            before = dict(vehicle.parameters)
            await killed_in_flight(vehicle)
            vehicle.parameters["FENCE_ALT_MAX"] = 60.0
            said = await MAVLinkVehicle(ADDRESS).restore()
            assert "FENCE_ALT_MAX = 60" in said[1]
            assert vehicle.parameters == before | {"FENCE_ALT_MAX": 60.0}

    run(flights())


def test_another_vehicle_gets_nothing_of_it(tmp_path):
    """Most vehicles are system 1: the number of the board tells them apart."""

    async def flights():
        async with StandIn() as vehicle:
            await killed_in_flight(vehicle)
        async with StandIn() as other:
            other.board = 18
            before = dict(other.parameters)
            async with MAVLinkVehicle(ADDRESS, LIMITS):
                assert len(files(tmp_path)) == 2
            assert other.parameters == before

    run(flights())
    assert files(tmp_path) == ["changed-parameters-ArduPilot-1.json"]


def test_an_error_that_leaves_old_values_names_them_and_their_file(tmp_path):
    async def flight():
        async with StandIn() as vehicle:
            link = MAVLinkVehicle(ADDRESS, LIMITS)
            await link.connect()
            await link.take_off()
            vehicle.drop = lambda message: True
            with pytest.raises(LinkError, match="nothing has been received"):
                await told(link, 0.1, 5.0)
            with pytest.raises(LinkError, match="during the landing") as ended:
                await link.close()
            (note,) = ended.value.__notes__
            assert "GUID_TIMEOUT = 3, FS_GCS_TIMEOUT = 5, FS_GCS_ENABLE = 0" in note
            assert "changed-parameters-ArduPilot-1.json" in note
            assert "--restore" in note

    run(flight())


def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_set(tmp_path):
    (tmp_path / "file").write_text("")

    async def connected():
        async with StandIn() as vehicle:
            before = dict(vehicle.parameters)
            with pytest.raises(LinkError, match="cannot be written"):
                await MAVLinkVehicle(ADDRESS, LIMITS, folder=tmp_path / "file" / "in").connect()
            assert vehicle.parameters == before

    run(connected())


@pytest.mark.parametrize("forged", [1, 2, 3])
def test_forged_values_of_parameters_are_neither_kept_nor_believed(forged):
    """A forged answer became the value that was put back at the end."""

    async def flight():
        async with StandIn() as vehicle:
            before = dict(vehicle.parameters)
            send = vehicle._send_parameter
            told_already = set()

            def lies(name):
                if name not in told_already:
                    told_already.add(name)
                    true = vehicle.parameters[name]
                    vehicle.parameters[name] = 5.0
                    for _ in range(forged):
                        send(name)
                    vehicle.parameters[name] = true
                send(name)

            vehicle._send_parameter = lies
            async with MAVLinkVehicle(ADDRESS, LIMITS):
                assert vehicle.parameters["GUID_TIMEOUT"] == 0.5
                assert vehicle.parameters["FS_GCS_ENABLE"] == 5.0
            assert vehicle.parameters == before

    run(flight())


def test_a_file_that_is_damaged_is_no_such_file(tmp_path):
    for number, text in enumerate(["", "{}", '{"parameters": 1}', "\x00", '{"vehicle": {}}']):
        (tmp_path / f"changed-parameters-ArduPilot-1-{number}.json").write_text(text)

    async def connected():
        async with StandIn():
            assert await MAVLinkVehicle(ADDRESS, LIMITS).restore() == []

    run(connected())
