"""An emulator in a process of its own, which a command starts and always ends."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from deadtime._base.errors import LinkError
from deadtime.links.parent_watch import first_line

#: Longest time to start, and to end after a request, s.
STARTING, ENDING = 30.0, 3.0

#: What a client connects to.
PORTS = ("navdata_port", "command_port", "control_port")


@contextmanager
def own_emulator(plant: str, seed: int) -> Iterator[dict[str, int]]:
    """Run ``deadtime emulate ardrone2`` on free ports: navdata, command and control.

    It runs in a separate session, so that Ctrl-C in the terminal does not end it before the drone
    has been landed.

    Raises
    ------
    LinkError
        If it does not start.
    """
    command = [sys.executable, "-m", "deadtime", "emulate", "ardrone2", "--json"]
    command += ["--port-base", "0", "--plant", plant, "--seed", str(seed)]
    # Its standard input is closed when this process ends, for whatever reason.
    command.append("--until-input-ends")
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # The equivalent of a session on Windows.
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
    )
    with process:
        try:
            yield _ports(process)
        finally:
            process.terminate()
            try:
                process.wait(ENDING)
            except subprocess.TimeoutExpired:
                process.kill()


def _ports(process: subprocess.Popen[str]) -> dict[str, int]:
    line = first_line(process, STARTING)
    try:
        ports = json.loads(line)
        return {name: int(ports[name]) for name in PORTS}
    except (ValueError, KeyError, TypeError):
        raise LinkError(
            f"the emulator did not start within {STARTING:g} s. To see the reason, run 'deadtime "
            "emulate ardrone2'"
        ) from None
