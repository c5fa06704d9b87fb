"""`run_trial`: run plant, relay and controller in one event loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from deadtime._base.validation import positive
from deadtime.links.udp.controller import Controller, ControllerOptions, ControllerReport
from deadtime.links.udp.network import Network
from deadtime.links.udp.plant import run_plant
from deadtime.links.udp.plant_options import PlantOptions, PlantReport
from deadtime.links.udp.policies import JitterBuffer, NewestWins, Policy
from deadtime.links.udp.relay import Relay, RelayOptions

UNUSED_ADDRESS = ("127.0.0.1", 0)


@dataclass(frozen=True)
class Trial:
    """Options of a run of the loop.

    Parameters
    ----------
    gain : float
        Gain of the controller, 1/s.
    forward_path, return_path : Network
        Network from the plant to the controller, and back.
    seed : int
        Seed of the random delays and losses.
    sample_time : float
        Time between two measurements, s.
    duration : float
        Duration of the run, s. The reference steps after `rest`.
    rest : float
        Time before the step, s.
    plant_gain : float
        Gain of the integrator.
    lag : float
        Lag of the plant, s.
    limit : float
        Largest magnitude of the command.

        On both sides.
    policy : Policy
        What the plant does with late commands.
    watchdog : float
        Time without a packet after which each side goes to its safe state, s.
    safe : float
        The command that is applied after such a silence.
    """

    gain: float
    forward_path: Network = field(default_factory=Network)
    return_path: Network = field(default_factory=Network)
    seed: int = 0
    sample_time: float = 0.01
    duration: float = 6.0
    rest: float = 1.0
    plant_gain: float = 1.0
    lag: float = 0.0
    limit: float = 20.0
    policy: Policy = field(default_factory=NewestWins)
    watchdog: float = 0.5
    safe: float = 0.0

    def __post_init__(self) -> None:
        positive("gain", self.gain)
        # Check the other options now, not when the loop runs.
        self.plant_options(UNUSED_ADDRESS)
        self.controller_options()

    def controller_options(self, recording: Path | None = None) -> ControllerOptions:
        """Options of the controller, on a free port of this computer."""
        return ControllerOptions(
            gain=self.gain,
            limit=self.limit,
            watchdog=self.watchdog,
            safe=self.safe,
            every=isinstance(self.policy, JitterBuffer),
            recording=recording,
        )

    def relay_options(self, controller: tuple[str, int]) -> RelayOptions:
        """Options of the relay, on a free port of this computer."""
        return RelayOptions(controller, self.forward_path, self.return_path, self.seed)

    def plant_options(
        self, controller: tuple[str, int], recording: Path | None = None
    ) -> PlantOptions:
        """Options of the plant, on a free port of this computer."""
        names = ("sample_time", "duration", "rest", "lag", "limit", "policy", "watchdog", "safe")
        shared = {name: getattr(self, name) for name in names}
        return PlantOptions(controller, gain=self.plant_gain, recording=recording, **shared)


@dataclass(frozen=True, eq=False)
class TrialReport:
    """Reports of both ends.

    Attributes
    ----------
    plant : PlantReport
        Report of the plant.
    controller : ControllerReport
        Report of the controller.
    """

    plant: PlantReport
    controller: ControllerReport

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON; without the recordings."""
        return {"plant": self.plant.to_dict(), "controller": self.controller.to_dict()}


async def run_trial(
    trial: Trial,
    folder: Path | None = None,
    *,
    stem: str = "",
    meanwhile: Callable[[Relay, Controller], None] | None = None,
) -> TrialReport:
    """Run plant, relay and controller in the running event loop.

    Parameters
    ----------
    trial : Trial
        Options of the run.
    folder : Path, optional
        Folder for the recordings of both ends, ``<stem>plant.csv`` and ``<stem>controller.csv``.
    stem : str
        Beginning of the names of the files.
    meanwhile : callable, optional
        Called before the run starts, to change the loop during the run.

    Returns
    -------
    TrialReport

    Examples
    --------
    Both directions with 50 ms, in virtual time:

    >>> from deadtime.links import virtual_time
    >>> from deadtime.links.udp import Network, Trial, run_trial
    >>> path = Network(delay=0.05)
    >>> report = virtual_time.run(run_trial(Trial(gain=8.0, forward_path=path, return_path=path)))
    >>> round(report.plant.link.round_trip.p50, 6), round(report.plant.age, 6)
    (0.1, 0.105)
    """
    files = [None if folder is None else folder / f"{stem}{end}.csv" for end in ENDS]
    async with Controller(trial.controller_options(files[1])) as controller:
        async with Relay(trial.relay_options(controller.address)) as relay:
            if meanwhile is not None:
                meanwhile(relay, controller)
            plant = await run_plant(trial.plant_options(relay.address, files[0]))
        return TrialReport(plant, controller.report())


#: The two ends, by the names of their recordings.
ENDS = ("plant", "controller")
