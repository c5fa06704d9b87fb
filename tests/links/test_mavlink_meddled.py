"""Whole flights of the stand-in with forged, late, repeated and missing messages of every kind."""

import asyncio
import warnings

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from deadtime import LinkError
from deadtime.links import Limits, Watch, now, run
from deadtime.links.mavlink import MAVLinkVehicle
from meddling import Meddler
from stand_in_autopilot import StandIn

ADDRESS = "udp:127.0.0.1:14550"
LIMITS = Limits(max_climb=1.0)

#: What has to stay as the link has set it while the vehicle flies.
FAILSAFES = {
    "ardupilot": ("GUID_TIMEOUT", "FS_GCS_TIMEOUT", "FS_GCS_ENABLE", "FENCE_ENABLE", "ANGLE_MAX"),
    "px4": ("COM_OF_LOSS_T", "COM_OBL_RC_ACT", "COM_DL_LOSS_T", "NAV_DLL_ACT", "GF_ACTION"),
}


async def programme(link, notes):
    """A flight as an experiment makes it; what ends it is noted."""
    try:
        async with link:
            await link.take_off()
            watch, end, speed = Watch(LIMITS, origin=await link.state()), now() + 8.0, 0.2
            while now() < end:
                watch.check(await link.state(), now())
                link.command(speed if int(now()) % 2 else -speed)
                await asyncio.sleep(0.065)
            await link.land()
    except LinkError as error:
        notes.append((str(error), getattr(error, "__notes__", [])))


async def meddled(firmware, seed):
    """A flight, 30 s after it, and a clean run; what was wrong, and how it ended."""
    wrong, notes = set(), []
    async with StandIn(firmware) as vehicle:
        before = dict(vehicle.parameters)
        link = MAVLinkVehicle(ADDRESS, LIMITS)
        send = vehicle.send
        meddler = Meddler.of(vehicle, seed)

        async def look():
            strict = None
            while True:
                flies = vehicle.height > 0.02
                held = {name: vehicle.parameters[name] for name in FAILSAFES[firmware]}
                strict = held if not flies or strict is None else strict
                if flies and held != strict:
                    wrong.add("failsafes changed in the air")
                if flies and held == {name: before[name] for name in held}:
                    wrong.add("in the air without failsafes")
                await asyncio.sleep(0.01)

        looking = asyncio.create_task(look())
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            await asyncio.wait_for(programme(link, notes), 300.0)
        await asyncio.sleep(30.0)
        looking.cancel()
        if vehicle.armed or vehicle.height > 0.0:
            wrong.add("armed after the end")
        if vehicle.parameters != before and "changed-parameters" not in str([*notes, *warned]):
            wrong.add("what stays changed was not named")
        vehicle.send, vehicle.drop = send, lambda message: False
        await MAVLinkVehicle(ADDRESS, LIMITS).restore()
        if vehicle.parameters != before:
            wrong.add("parameters are not as before")
    return wrong, notes, meddler.done


def survey(seeds):
    ended = 0
    for seed in seeds:
        firmware = "px4" if seed % 4 == 3 else "ardupilot"
        wrong, notes, done = run(meddled(firmware, seed))
        assert not wrong, f"seed {seed}: {wrong}, ended by {notes}, after {done}"
        ended += bool(notes)
    return ended


def test_no_few_messages_leave_a_vehicle_in_the_air_without_its_failsafes_or_armed():
    survey(range(3))


@pytest.mark.survey
@pytest.mark.parametrize(
    "first", [0, *(pytest.param(k, marks=pytest.mark.long) for k in range(20, 200, 20))]
)
def test_of_200_meddled_flights_none_ends_in_the_air_or_with_other_parameters(first):
    """Few of them are ended by it."""
    assert survey(range(first, first + 20)) <= 10
