"""One run of the loop with plant, relay and controller in a process each."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from deadtime._base.errors import LinkError
from deadtime.links.addresses import Address
from deadtime.links.parent_watch import first_line
from deadtime.links.udp.described import arguments_of
from deadtime.links.udp.trial import ENDS, Trial

#: Longest time until a process is ready, and until it has ended, s.
TIMEOUT = 30.0


class Part:
    """A process of the loop."""

    def __init__(self, name: str, arguments: Sequence[str]) -> None:
        self.name = name
        # Not a pipe of Popen, because `communicate` closes that at once.
        its_end, self._parent_watch = os.pipe()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "deadtime.links.udp", name, "--until-input-ends", *arguments],
            stdin=its_end,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        os.close(its_end)

    def address(self) -> Address:
        """Its address, once it is ready."""
        line = first_line(self.process, TIMEOUT)
        if not line:
            _, errors = self.process.communicate()
            raise LinkError(f"the {self.name} did not start: {_last_line(errors)}")
        ready = json.loads(line)
        return ready["host"], ready["port"]

    def report(self, within: float) -> dict[str, Any]:
        """Its report at its end, which has to be within so many seconds."""
        try:
            out, errors = self.process.communicate(timeout=within)
        except subprocess.TimeoutExpired:
            raise LinkError(f"the {self.name} did not end within {within:g} s") from None
        lines = out.splitlines()
        if self.process.returncode != 0 or not lines:
            raise LinkError(
                f"the {self.name} ended too early (exit code {self.process.returncode}): "
                f"{_last_line(errors)}"
            )
        found: dict[str, Any] = json.loads(lines[-1])["report"]
        return found

    def end(self) -> None:
        """End the process, if it still runs."""
        self.process.kill()
        self.process.communicate()
        os.close(self._parent_watch)


def _last_line(errors: str) -> str:
    return errors.strip().splitlines()[-1] if errors.strip() else "it printed no error"


@contextmanager
def part(name: str, arguments: Sequence[str]) -> Iterator[Part]:
    """Start a process of the loop; it ends with the context, or with this process."""
    started = Part(name, arguments)
    try:
        yield started
    finally:
        started.end()


def run_processes(trial: Trial, folder: Path, *, stem: str = "") -> dict[str, dict[str, Any]]:
    """Run plant, relay and controller as processes on this computer, over its loopback.

    Parameters
    ----------
    trial : Trial
        What to run.
    folder : Path
        Folder for the recordings of both ends, ``<stem>plant.csv`` and ``<stem>controller.csv``.
    stem : str
        Beginning of the names of the files.

    Returns
    -------
    dict of str to dict
        Reports of the ``plant`` and the ``controller``, from `PlantReport.to_dict` and
        `ControllerReport.to_dict`, with None in place of NaN.

    Raises
    ------
    LinkError
        When a process does not start, or ends before its time.
    """
    files = {end: folder / f"{stem}{end}.csv" for end in ENDS}
    with ExitStack() as stack:
        options = trial.controller_options(files["controller"])
        controller = stack.enter_context(part("controller", arguments_of(options)))
        between = arguments_of(trial.relay_options(controller.address()))
        relay = stack.enter_context(part("relay", between))
        plant_options = trial.plant_options(relay.address(), files["plant"])
        plant = stack.enter_context(part("plant", arguments_of(plant_options)))
        reports = {"plant": plant.report(trial.duration + TIMEOUT)}
        controller.process.terminate()
        reports["controller"] = controller.report(TIMEOUT)
    return reports
