"""ArduPilot's Copter in its software-in-the-loop build: where it is, and how it is started."""

import os
import signal
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

import pytest


def executable():
    """The firmware: that of DEADTIME_ARDUCOPTER, or the one beside the checkout."""
    told = os.environ.get("DEADTIME_ARDUCOPTER")
    beside = Path(__file__).resolve().parents[3] / "shared" / "sitl" / "arducopter"
    place = Path(told) if told else beside
    return place if os.access(place, os.X_OK) else None


def alone():
    """What runs a command with loopback as its only network: the firmware listens on all.

    Before other processes where that is allowed: a firmware at the speed of the clock needs little
    of a processor, and at once.
    """
    up = 'renice -n -10 $$ >/dev/null 2>&1; ip link set lo up && exec "$@"'
    return ["unshare", "-n" if os.geteuid() == 0 else "-rn", "sh", "-c", up, "sh"]


def skip_without_firmware():
    if executable() is None:
        pytest.skip(
            "no ArduCopter: DEADTIME_ARDUCOPTER names none, and none is beside the checkout"
        )
    try:
        subprocess.run([*alone(), "true"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no network namespace, and the firmware listens on all interfaces")


def told_by(program, *options, timeout):
    """What a program of this folder prints: it flies the firmware, in a network of its own."""
    skip_without_firmware()
    here = Path(__file__).parent
    paths = os.pathsep.join(filter(None, [str(here), os.environ.get("PYTHONPATH")]))
    done = subprocess.run(
        [*alone(), sys.executable, str(here / program), *options],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=timeout,
    )
    if "s old, but at most" in done.stderr:
        pytest.skip("this machine is too busy for a loop in real time")
    assert done.returncode == 0, done.stderr
    return done.stdout


@contextmanager
def firmware(*serials, longest=600):
    """Run it at the speed of the clock, for so many seconds, in a network that `alone` has made."""
    place = executable()
    options = ["--model", "quad", "--speedup", "1", "--home", "38.7,-9.1,100,0", "-w", "-I0"]
    for number in range(3):
        options += [f"--serial{number}", serials[number] if number < len(serials) else "none"]
    options += ["--defaults", str(place.parent / "copter.parm")]
    with tempfile.TemporaryDirectory() as folder, Path(folder, "said").open("w") as said:
        process = subprocess.Popen(
            ["timeout", str(longest), str(place), *options], cwd=folder, stdout=said, stderr=said
        )
        try:
            yield process
        finally:
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
