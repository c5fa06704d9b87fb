"""Estimates on flights against ArduPilot's Copter: what is added to the delay must come out.

The vehicle limits acceleration and jerk of the velocity that it is told (`deadtime.RateLimited`),
and its controller of the velocity lets that overshoot. Each flight is estimated with the plants of
`PLANTS`: an integrator and a lag without these limits, that after them, as the vehicle says them,
and an integrator, two lags and a zero after them. The sum is that of delay and lags less the zero.
It is compared between flights whose commands waited for different times before they were sent.

An estimate should be reliable where the unexplained part of the rise is below twice the noise of
the quiet rows: the deviation of the residuals around their mean over `QUIET` seconds, in the first
`RISE` seconds after each step, beside that in the last ones before the next. The wandering of the
vehicle over longer times shows in neither.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import deadtime as dtm
import numpy as np

from reality.dataflash import recording_of
from reality.flights import GAINS, HOLD, LIMIT, SAMPLE, SHAPING, WINDS, Flight

#: Times added to the commands, s; flights of each kind.
ADDED, REPEATS = (0.0, 0.10, 0.25), 3

#: Parts of the time after a step: the rise, and the end of it, s.
RISE, QUIET = 3.0, 2.0

#: The sum has to rise by what was added within this, s.
WITHIN = 0.015

#: Clocks that are this far from a line, in s, cannot be converted: the machine stood still.
CLOCK = 0.005

#: Plants, whether behind the limits of the vehicle, and what is fitted.
PLANTS: dict[str, tuple[bool, Any, tuple[str, ...]]] = {
    "lag": (False, dtm.Integrator(1.0, lag=0.1), ("delay", "gain", "lag")),
    "limits": (True, dtm.Integrator(1.0, lag=0.1), ("delay", "gain", "lag")),
    "zero": (
        True,
        dtm.FactoredPlant([0.15, 0.1], zero=0.2, integrator=True),
        ("delay", "gain", "lag_1", "lag_2", "zero"),
    ),
}


#: What the fit of the last of them says where a third lag makes the flight likelier: it is added.
FURTHER = "a further lag of"
THREE_LAGS = dtm.FactoredPlant([0.15, 0.1, 0.07], zero=0.2, integrator=True)


class Estimated(NamedTuple):
    """One estimate; times in s, the noise in m."""

    flight: Flight
    plant: str
    total: float
    interval: tuple[float, float]
    gain: float
    reliable: bool
    unexplained: float
    noise: float
    message: str


def executable() -> Path | None:
    """The firmware: that of DEADTIME_ARDUCOPTER, or the one beside the checkout."""
    root = Path(__file__).resolve().parents[2]
    places = [root.parent / "shared" / "sitl" / "arducopter"]
    if told := os.environ.get("DEADTIME_ARDUCOPTER"):
        places = [Path(told)]
    return next((place for place in places if os.access(place, os.X_OK)), None)


def why_not() -> str | None:
    """Why no flight is possible here, or None."""
    if executable() is None:
        return (
            "no ArduCopter: give the path of its software-in-the-loop build in DEADTIME_ARDUCOPTER"
        )
    try:
        import pymavlink  # noqa: F401
    except ImportError:
        return "no pymavlink: pip install 'deadtime[bench]'"
    try:
        subprocess.run([*alone(), "true"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        return "no network namespace (unshare -rn), and the firmware listens on all interfaces"
    return None


def alone() -> list[str]:
    """What runs a command with loopback as its only network."""
    up = 'ip link set lo up && exec "$@"'
    return ["unshare", "-n" if os.geteuid() == 0 else "-rn", "sh", "-c", up, "sh"]


def fly(folder: Path, flights: Iterable[Flight]) -> None:
    """Fly, one session of the firmware for each wind at once, before other processes."""
    firmware, reason = executable(), why_not()
    if firmware is None or reason is not None:
        raise SystemExit(f"cannot fly: {reason}")
    script = Path(__file__).with_name("flights.py")
    first = ["nice", "-n", "-10"] if os.geteuid() == 0 else []
    sessions: dict[str, list[str]] = {}
    for flight in flights:
        sessions.setdefault(flight.wind, []).append(flight.name)
    running = [
        subprocess.Popen(
            [*first, *alone(), sys.executable, str(script), str(firmware), str(folder), *names],
            stderr=subprocess.PIPE,
            text=True,
        )
        for names in sessions.values()
    ]
    said = [process.communicate()[1] for process in running]
    sys.stderr.writelines(said)
    reasons = [
        words.strip().rpartition("\n")[2]
        for process, words in zip(running, said, strict=True)
        if process.returncode != 0
    ]
    if reasons:
        raise SystemExit(
            f"a session of the firmware failed, and its words are in firmware.log: "
            f"{'; '.join(reasons)}"
        )


def estimated(folder: Path, flight: Flight, plant: str, own_log: bool = False) -> Estimated:
    """Estimate one flight with a plant of `PLANTS`; this runs in other processes.

    `own_log`: from the log of the vehicle, not from that of the controller.
    """
    warnings.simplefilter("ignore")  # about feedback
    facts = facts_of(folder, flight)
    if own_log:
        recording = recording_of(folder / facts["log"], facts["number"], flight.axis)
    else:
        recording = dtm.read_recording(
            folder / f"{flight.name}.csv",
            time="time",
            reference="reference",
            output="output",
            command="command",
        )
    acceleration, jerk = (facts["parameters"][name] for name in SHAPING[flight.axis])
    limited, vehicle, free = PLANTS[plant]
    if limited:
        vehicle = dtm.RateLimited(vehicle, rate=0.01 * acceleration, rate_of_rate=jerk)
    loop = dtm.ControlLoop(vehicle, dtm.P(GAINS[flight.axis]), sample_time=SAMPLE, limit=LIMIT)
    # What the controller computes from is not in the log of the vehicle.
    method = "output_error" if own_log else "auto"
    try:
        if not own_log and facts["clock_misfit"] > CLOCK:
            late = 1e3 * facts["clock_misfit"]
            raise dtm.NotIdentifiableError(f"the clocks are {late:.0f} ms from a line")
        fit = dtm.estimate_delay(recording, loop, free=free, method=method)
        if plant == "zero" and FURTHER in fit.message:
            with_third = dtm.RateLimited(THREE_LAGS, vehicle.rate, vehicle.rate_of_rate)
            loop = dataclasses.replace(loop, plant=with_third)
            fit = dtm.estimate_delay(recording, loop, free=(*free, "lag_3"), method=method)
    except dtm.NotIdentifiableError as error:
        nothing = (math.nan, math.nan)
        return Estimated(
            flight, plant, *nothing[:1], nothing, math.nan, False, *nothing, str(error)
        )
    steps = [step.time for step in recording.steps()]

    def around_mean(*begins: float) -> float:
        """Deviation of the residuals over `QUIET` seconds that begin so long after each step."""
        return float(
            np.sqrt(
                np.mean(
                    [
                        np.var(fit.residuals[(recording.time > at) & (recording.time < at + QUIET)])
                        for step in steps
                        for at in (step + begin for begin in begins)
                    ]
                )
            )
        )

    return Estimated(
        flight,
        plant,
        fit.delay_plus_lag,
        fit.ci(0.95, "delay+lag"),
        fit.loop.parameters["gain"],
        fit.verdict == "reliable",
        around_mean(0.0, RISE - QUIET),
        around_mean(HOLD - QUIET),
        fit.message,
    )


def facts_of(folder: Path, flight: Flight) -> dict[str, Any]:
    """What is known of a flight beside its recording."""
    facts: dict[str, Any] = json.loads((folder / f"{flight.name}.json").read_text(encoding="utf-8"))
    return facts


def print_table(folder: Path, flights: Sequence[Flight], processes: int) -> None:
    """Estimate all flights and print them, then what the sums rise by."""
    print(
        f"{'flight':24}{'plant':>7}{'sum':>8}{'95 % interval':>19}{'gain':>7}{'rise mm':>9}"
        f"{'quiet mm':>9}  reliable, or why not"
    )
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        waiting = [
            pool.submit(estimated, folder, flight, plant) for plant in PLANTS for flight in flights
        ]
        found = []
        for one in waiting:
            found.append(one.result())
            print(line(found[-1]), flush=True)
    print(f"\n{'rise of the sum, s':24}{'plant':>7}{'added':>7}{'rise':>8}  by repeat; overlap")
    for plant, axis, wind in product(PLANTS, GAINS, WINDS):
        print_rises(
            f"{axis}, {wind}",
            [e for e in found if (e.plant, *e.flight[:2]) == (plant, axis, wind)],
        )
    for name in sorted({flight.wind for flight in flights}):
        print_jitter(folder, name, [flight for flight in flights if flight.wind == name])


def line(one: Estimated) -> str:
    """One estimate."""
    low, high = one.interval
    _, found, reasons = one.message.partition("indication: ")
    reasons = reasons.rpartition(" (try")[0] if found else one.message
    return (
        f"{one.flight.name:24}{one.plant:>7}{one.total:8.3f}"
        f"{low:10.3f} –{high:7.3f}{one.gain:7.3f}{1e3 * one.unexplained:9.1f}"
        f"{1e3 * one.noise:9.1f}  {'reliable' if one.reliable else reasons}"
    )


def print_rises(name: str, found: Sequence[Estimated]) -> None:
    """By how much the sum rises over that without added delay, and whether repeats agree."""
    found = [one for one in found if not math.isnan(one.total)]
    base = np.mean([one.total for one in found if one.flight.added == 0.0])
    for added in sorted({one.flight.added for one in found}):
        some = [one for one in found if one.flight.added == added]
        rises = np.array([one.total for one in some]) - base
        overlap = max(e.interval[0] for e in some) <= min(e.interval[1] for e in some)
        right = abs(float(np.mean(rises)) - added) <= WITHIN
        print(
            f"{name:24}{some[0].plant:>7}{added:7.2f}{np.mean(rises):8.3f}"
            f"  {' '.join(f'{rise:.3f}' for rise in rises)}; "
            f"{'overlap' if overlap else 'no overlap'}; {'met' if right else 'missed'}"
        )


def print_jitter(folder: Path, wind: str, flights: Sequence[Flight]) -> None:
    """How late the loop was."""
    facts = [facts_of(folder, flight) for flight in flights]
    facts = [one for one in facts if one["clock_misfit"] <= CLOCK]
    late = np.array([one["late"] for one in facts])
    sent = np.array([one["sent_late"] for one in facts])
    print(
        f"{wind}: samples late by {1e3 * np.sqrt(np.mean(late[:, 0] ** 2)):.1f} ms rms, at most "
        f"{1e3 * late[:, 1].max():.0f} ms; commands sent late by "
        f"{1e3 * np.sqrt(np.mean(sent[:, 0] ** 2)):.1f} ms rms, at most "
        f"{1e3 * sent[:, 1].max():.0f} ms; clocks agree with a line within "
        f"{1e3 * max(one['clock_misfit'] for one in facts):.1f} ms"
    )


def run(read: Path | None, keep: Path | None, processes: int, quick: bool) -> None:
    """Fly, unless recordings are to be read, and print the tables."""
    kinds = product(range(1, REPEATS + 1), WINDS, GAINS, ADDED)
    flights = [Flight(axis, wind, added, repeat) for repeat, wind, axis, added in kinds]
    if quick:
        flights = [f for f in flights if f.axis == "height" and f.repeat == 1 and f.wind == "calm"]
    with tempfile.TemporaryDirectory() as own:
        folder = read or keep or Path(own)
        if read is None:
            folder.mkdir(parents=True, exist_ok=True)
            fly(folder, flights)
        there = [flight for flight in flights if (folder / f"{flight.name}.csv").exists()]
        print_table(folder, sorted(there), processes)
