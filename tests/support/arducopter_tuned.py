"""The gain of ArduCopter's height loop: proposed from its log, set over MAVLink, flown.

The first flight steps the height under the vehicle's own gain, in GUIDED, so that the firmware's
position loop closes. `tune_loop` proposes a gain from the log. The second flight steps again under
it. The prediction takes the firmware's own shaped set point and feed-forward from the second log:
it commands v + K (p - y), which is K (p + v/K - y). Prints one line of JSON.
"""

import asyncio
import json
import os
import shutil
import sys
from pathlib import Path

import deadtime as dtm
import numpy as np
from arducopter import firmware
from deadtime.links import Limits
from deadtime.links.mavlink import MAVLinkVehicle

PORT, GAIN, LOOP = 14550, "PSC_POSZ_P", "altitude"

LIMITS = Limits(max_climb=2.5, max_height=12.0, max_missing=100, max_state_age=0.5)

#: Heights, m, and for how long each is asked for, s: the first flight moves at uneven times.
LEARN = ((5.0, 5.0), (6.0, 3.1), (4.5, 4.3), (6.5, 2.2), (5.0, 5.2), (5.8, 1.7), (4.4, 3.6),
         (6.2, 4.4), (5.0, 2.6), (4.2, 3.9), (5.5, 5.0))  # fmt: skip
FLY = ((5.0, 8.0), (6.0, 8.0), (5.0, 8.0))

#: Time between the rows of a prediction, s: far below the times of the loop.
STEP = 0.02


async def flight(heights, gain=None):
    """Fly the heights; the gain that the vehicle had meanwhile."""
    async with MAVLinkVehicle(f"udp:127.0.0.1:{PORT}", LIMITS, take_off_height=5.0) as link:
        await link.allow("position")
        if gain is not None:
            await link.set_parameter(GAIN, gain)
        flown = await link.parameter(GAIN)
        await link.take_off()
        place = await link.state()
        for height, seconds in heights:
            for _ in range(round(20 * seconds)):
                link.command_position(place.north, place.east, height, place.yaw)
                await asyncio.sleep(0.05)
        await link.land()
    await asyncio.sleep(0.5)  # until the port is free
    return flown


async def held():
    async with MAVLinkVehicle(f"udp:127.0.0.1:{PORT}", LIMITS) as link:
        return await link.parameter(GAIN)


def log_of(process, folder, name):
    """A copy of the newest log of the running firmware."""
    logs = Path(os.readlink(f"/proc/{process.pid}/cwd"), "logs")
    newest = max(logs.glob("*.BIN"), key=lambda path: path.stat().st_mtime)
    return Path(shutil.copy(newest, folder / name))


def flown_facts(path, found, since):
    """How the response of the second flight lies in the band, and both overshoots, %."""
    log = dtm.open_log(path)
    topic = log.contents.topics["PSCD"]
    time = topic.time - log.start
    place, speed, height = (-topic.columns[name] for name in ("TPD", "DVD", "PD"))
    # The steps of this flight: from the last rest before the first of them on.
    windows = [ends for ends in log.loop(LOOP).segments if ends[1] > since]
    start, stop = max(windows, key=lambda ends: ends[1] - ends[0])
    rows = (time >= start) & (time <= stop)
    time, place, speed, height = time[rows], place[rows], speed[rows], height[rows]
    moving = np.flatnonzero(np.abs(speed) > 0.02)
    first = moving[moving > np.flatnonzero(np.abs(speed) < 0.005)[0]][0]
    time, place, speed, height = (one[first - 5 :] for one in (time, place, speed, height))
    gain = found.controller.gains["Kp"]
    fine = np.arange(time[0], time[-1], STEP)
    asked = np.interp(fine, time, place + speed / gain)
    outputs, low, high = found.predict(fine, asked)
    seen = np.interp(fine, time, height)
    inside = (seen >= low) & (seen <= high)
    size = float(np.ptp(place))
    return {
        "rows": int(time.size),
        "inside": float(inside.mean()),
        "band": float(np.max(high - low) / size),
        "overshoot": overshoot(seen, place, size),
        "predicted_overshoot": overshoot(outputs, place, size),
        "largest_error": float(np.max(np.abs(seen - outputs)) / size),
    }


def overshoot(outputs, place, size):
    """How far the response goes beyond its set points, % of the step."""
    return 100.0 * max(0.0, float(np.max(outputs) - np.max(place)),
                       float(np.min(place) - np.min(outputs))) / size  # fmt: skip


def main(folder):
    with firmware(f"udpclient:127.0.0.1:{PORT}") as process:
        before = asyncio.run(flight(LEARN))
        log = dtm.open_log(log_of(process, folder, "first.bin"))
        found = dtm.logs.tune_loop(log, LOOP)
        print(found.summary(), file=sys.stderr, flush=True)
        gain = found.settings.values[GAIN]
        during = asyncio.run(flight(FLY, gain))
        after = asyncio.run(held())
        facts = flown_facts(log_of(process, folder, "second.bin"), found, log.duration)
    print(json.dumps({
        "verdict": found.verdict,
        "lines": found.settings.lines,
        "before": before,
        "proposed": gain,
        "during": during,
        "after": after,
        **facts,
    }))  # fmt: skip


if __name__ == "__main__":
    main(Path(sys.argv[1]))
