"""The drone's own limits are set as requested, read back, and restored afterwards."""

import asyncio
import contextlib

import pytest
from deadtime import LinkError
from deadtime.links import Limits, run
from deadtime.links.ardrone2 import ARDrone2
from deadtime.links.ardrone2.emulator.settings import Settings
from emulated import client_of, connected, emulator
from worst_case_drone import WorstCaseDrone, connected_drone

BOTH = ("control:control_vz_max", "control:altitude_max")


def held(drone):
    return [float(drone.settings[key]) for key in BOTH]


@pytest.mark.parametrize(
    ("climb", "set_to"),
    [(0.3, 300), (0.5, 500), (1.0, 1000), (1.1, 1100), (0.05, 200), (2.0, 2000)],
)
def test_the_drone_s_climb_limit_is_set_as_requested_and_restored(climb, set_to):
    # The limit must not stay at a default of 1 m/s, nor stay changed after the flight.
    async def fly():
        async with WorstCaseDrone() as drone:
            limits = Limits(max_climb=climb, max_height=2.5)
            async with ARDrone2("127.0.0.1", limits, **drone.ports) as client:
                assert held(drone) == [set_to, 2500]
                assert client.vz_max == pytest.approx(1e-3 * set_to)
                await client.take_off()
                assert client.command(9.0) == pytest.approx(climb, rel=1e-6)
                await asyncio.sleep(0.05)
                assert drone.gaz * 1e-3 * set_to == pytest.approx(climb, rel=1e-6)
                await client.land()
                assert held(drone) == [set_to, 2500]  # Unchanged until the end of the last flight.
            assert drone.phase == "landed"
            assert held(drone) == [700, 3000]

    run(fly())


async def fails(drone, how):
    async with ARDrone2("127.0.0.1", Limits(max_climb=0.3), **drone.ports) as client:
        await client.take_off()
        client.command(0.2)
        if how == "pause":
            drone.pause_client(5.0)
            client.hover()
        await asyncio.sleep(0.1)
        raise ZeroDivisionError


@pytest.mark.parametrize("how", ["exception", "cancelled", "pause"])
def test_settings_are_restored_after_the_landing_however_a_flight_ends(how):
    async def fly():
        async with WorstCaseDrone() as drone:
            put, plain = [], drone.settings.__class__.__setitem__

            class RecordingSettings(dict):
                def __setitem__(self, key, value):
                    put.append((key, value, drone.phase))
                    plain(self, key, value)

            drone.settings = RecordingSettings(drone.settings)
            flight = asyncio.create_task(fails(drone, how))
            if how == "cancelled":
                await asyncio.sleep(1.0)
                flight.cancel()
            await asyncio.wait([flight])
            assert flight.cancelled() is (how == "cancelled")
            assert held(drone) == [700, 3000]
            assert {phase for key, _, phase in put if key in BOTH} == {"landed"}

    run(fly())


def test_settings_of_a_drone_that_stops_answering_are_not_waited_for_and_reported():
    async def fly():
        async with WorstCaseDrone() as drone:
            ended = None
            try:
                async with ARDrone2("127.0.0.1", **drone.ports) as client:
                    await client.take_off()
                    drone._deliver = lambda packet: None
                    silent = asyncio.get_running_loop().time()
                    await asyncio.sleep(0.9)
                    await client.land()
            except LinkError as error:
                ended = error
            assert "control:control_vz_max = 700" in " ".join(ended.__notes__)
            assert asyncio.get_running_loop().time() - silent < 8.0

    run(fly())


def test_a_setting_that_cannot_be_restored_causes_a_warning(monkeypatch):
    async def fly():
        async with emulator() as emulated:
            drone = client_of(emulated)
            await drone.connect()
            monkeypatch.setattr(Settings, "set", lambda self, name, value: False)
            begun = asyncio.get_running_loop().time()
            with pytest.warns(RuntimeWarning, match="could not be restored .*control_vz_max = 7"):
                await drone.close()
            assert asyncio.get_running_loop().time() - begun < 4.0

    run(fly())


def test_a_failed_connection_leaves_the_settings_unchanged(monkeypatch):
    plain = Settings.set

    def refuses_a_height(self, name, value):
        return name == BOTH[1] or plain(self, name, value)

    async def fly():
        async with emulator() as emulated:
            monkeypatch.setattr(Settings, "set", refuses_a_height)
            with pytest.raises(LinkError, match=r"altitude_max was set to .* the drone reports"):
                await client_of(emulated, Limits(max_height=2.5)).connect()
            assert emulated.drone.settings.climb_limit == 0.7

    run(fly())


def test_a_second_connection_of_one_object_uses_new_navdata_only():
    # Navdata from before the reconnection must not count as current.
    async def fly():
        async with connected_drone() as (drone, client):
            await client.take_off()
            drone.pause_client(5.0)
            with contextlib.suppress(LinkError):
                client.hover()
            await client.close()
            before = client.statistics.packets
            await client.connect()
            assert client.statistics.packets < 0.5 * before
            await client.take_off()
            client.command(0.1)

    run(fly())


def test_two_flights_find_the_same_settings():
    async def fly():
        async with connected(Limits(max_climb=0.3)) as (emulated, drone):
            assert emulated.drone.settings.climb_limit == 0.3
            await drone.close()
            assert emulated.drone.settings.climb_limit == 0.7
            await asyncio.sleep(3.0)
            await drone.connect()
            assert emulated.drone.settings.climb_limit == 0.3

    run(fly())
