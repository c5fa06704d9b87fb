"""An emulator that a command starts for itself, and ends whatever happens."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer

from deadtime._base.errors import LinkError

__all__ = ["own_emulator"]

#: How long it may take to start, and to end when asked to, s.
STARTING, ENDING = 30.0, 3.0


@contextmanager
def own_emulator(plant: str, seed: int) -> Iterator[tuple[int, int, int]]:
    """Run ``deadtime emulate ardrone2`` on free ports: navdata, command and control.

    It has a session of its own: Ctrl-C in the terminal must not end it before what flies it has
    been landed.

    Raises
    ------
    LinkError
        If it does not start.
    """
    command = [sys.executable, "-m", "deadtime", "emulate", "ardrone2", "--json"]
    command += ["--port-base", "0", "--plant", plant, "--seed", str(seed)]
    # Its input ends with this process, however that ends.
    command.append("--until-input-ends")
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # What Windows has in place of sessions.
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
    )
    try:
        yield _ports(process)
    finally:
        _end(process)


def _ports(process: subprocess.Popen[str]) -> tuple[int, int, int]:
    assert process.stdout is not None
    late = Timer(STARTING, process.kill)
    late.start()
    try:
        line = process.stdout.readline()
    finally:
        late.cancel()
    try:
        told = json.loads(line)
        return int(told["navdata_port"]), int(told["command_port"]), int(told["control_port"])
    except (ValueError, KeyError, TypeError):
        raise LinkError(
            f"the emulator did not start within {STARTING:g} s: run 'deadtime emulate ardrone2' "
            "to see why"
        ) from None


def _end(process: subprocess.Popen[str]) -> None:
    process.terminate()
    try:
        process.wait(ENDING)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            stream.close()
