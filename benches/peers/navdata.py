"""The drone's packets beside pyardrone: time a packet, alternated in one process.

Both read a short packet of navdata (500 bytes). Of a full one pyardrone reads only some options in
their older sizes, so that line has no peer. pyardrone makes views of the bytes, ours checks and
converts to SI units. Run ``python benches/peers/navdata.py [--quick]``.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable

from deadtime.links.ardrone2 import commands
from deadtime.links.ardrone2.navdata import (
    DEMO_OPTIONS,
    FULL_OPTIONS,
    Navdata,
    build_navdata,
    parse_navdata,
)
from deadtime.links.ardrone2.navdata_options import Demo, KalmanPressure, Pwm

try:
    with warnings.catch_warnings():
        # Its docstrings have escapes that cause warnings of Python.
        warnings.simplefilter("ignore")
        from pyardrone import at
        from pyardrone.navdata import NavData
except ImportError:
    at = NavData = None


def seconds(call: Callable[[], object], calls: int) -> float:
    start = time.perf_counter()
    for _ in range(calls):
        call()
    return (time.perf_counter() - start) / calls


def show(name: str, rounds: int, calls: int, ours: Callable[[], object], theirs: object) -> None:
    times = [[], []]
    for _ in range(rounds):
        for column, call in zip(times, (theirs, ours), strict=True):
            if call is not None:
                column.append(seconds(call, calls))
    best = min(times[1]) * 1e6
    if times[0]:
        peer = min(times[0]) * 1e6
        print(f"{name:36s}{peer:11.2f}{best:11.2f}{peer / best:11.2f}")
    else:
        print(f"{name:36s}{'':11s}{best:11.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a moment's run, rough numbers")
    rounds, calls = (3, 200) if parser.parse_args().quick else (15, 5000)

    demo = Demo(major=3, battery=80, height=1.25, pitch=-0.02)
    flight = Navdata(0x0F8004D5, 7, demo=demo, options=DEMO_OPTIONS)
    full = Navdata(
        0x0F8000D5,
        7,
        demo=demo,
        clock=12.5,
        pwm=Pwm(vz_ref=0.2),
        kalman_pressure=KalmanPressure(est_z=1.25, est_zdot=0.2),
        options=FULL_OPTIONS,
    )
    short_packet, full_packet = build_navdata(flight), build_navdata(full)
    if NavData is None:
        print("pyardrone is not installed: pip install pyardrone")
        theirs = dict.fromkeys(["read", "height", "write"])
    else:
        assert NavData(short_packet).demo.altitude == 1250
        theirs = {
            "read": lambda: NavData(short_packet),
            "height": lambda: NavData(short_packet).demo.altitude / 1000,
            "write": lambda: at.PCMD(1, 0, 0, 0.5, 0)._pack(7),
        }
    move = commands.Move(gaz=0.5)
    datagram = commands.encode([commands.Ref(take_off=True), move], 1)
    print(f"{'µs a packet':36s}{'pyardrone':>11s}{'ours':>11s}{'ratio':>11s}")
    for name, ours, peer in [
        ("short navdata, read", lambda: parse_navdata(short_packet), theirs["read"]),
        ("short navdata, height", lambda: parse_navdata(short_packet).height, theirs["height"]),
        ("full navdata, read", lambda: parse_navdata(full_packet), None),
        ("short navdata, write", lambda: build_navdata(flight), None),
        ("full navdata, write", lambda: build_navdata(full), None),
        (
            "motion, made and written",
            lambda: commands.encode([commands.Move(gaz=0.5)], 7),
            theirs["write"],
        ),
        ("two commands, read", lambda: commands.decode(datagram), None),
    ]:
        show(name, rounds, calls, ours, peer)


if __name__ == "__main__":
    main()
