"""The parameters that a run has changed in a vehicle, on disk until they are put back.

A run that is killed puts nothing back. Its file says what the vehicle had, and what was set, so
that a later run can tell what was left from what is the vehicle's own.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

from deadtime._base.printable import printable


@dataclass(frozen=True)
class VehicleId:
    """Which vehicle it is.

    Attributes
    ----------
    autopilot : str
        Name of the firmware.
    system : int
    unique : str
        Number of its board; empty where it does not say one.
    """

    autopilot: str
    system: int
    unique: str = ""

    def may_be(self, other: VehicleId) -> bool:
        """Whether both may be the same one."""
        same_board = self.unique == other.unique or not (self.unique and other.unique)
        return (self.autopilot, self.system) == (other.autopilot, other.system) and same_board


@dataclass(frozen=True)
class Change:
    """A parameter before it was changed, and what was set."""

    before: float
    set: float


@dataclass
class ChangedParameters:
    """The changed parameters of one vehicle, and their file.

    Attributes
    ----------
    vehicle : VehicleId
    path : Path
    written : str
        When the file was begun, UTC.
    changes : dict of str to Change
        By the name of the parameter.
    """

    vehicle: VehicleId
    path: Path
    written: str = ""
    changes: dict[str, Change] = field(default_factory=dict)

    @classmethod
    def new(cls, vehicle: VehicleId, folder: Path) -> Self:
        """Nothing is changed yet; the name of the file is a free one."""
        number, path = 1, folder / f"{_name(vehicle)}.json"
        while path.exists():
            number += 1
            path = folder / f"{_name(vehicle)}-{number}.json"
        return cls(vehicle, path, datetime.now(UTC).isoformat(timespec="seconds"))

    @classmethod
    def read(cls, path: Path) -> Self | None:
        """What a file says; None if it is no such file."""
        try:
            text = json.loads(path.read_text(encoding="utf-8"))
            changes = {
                printable(str(name)): Change(float(change["before"]), float(change["set"]))
                for name, change in text["parameters"].items()
            }
            board = text["vehicle"]
            vehicle = VehicleId(str(board["autopilot"]), int(board["system"]), str(board["unique"]))
            return cls(vehicle, path, printable(str(text["written"])), changes)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None

    @classmethod
    def left(cls, vehicle: VehicleId, folder: Path | None) -> list[Self]:
        """What earlier runs have left in a vehicle.

        By their files in a folder, in the folders in it, and beside it; without a folder in the
        working directory and the folders in it.
        """
        places = [Path()] if folder is None else [folder, folder.absolute().parent]
        found = (cls.read(path) for path in dict.fromkeys(_candidates(vehicle, places)))
        mine = [record for record in found if record is not None and record.vehicle.may_be(vehicle)]
        return sorted(mine, key=lambda record: record.written)

    def save(self) -> None:
        """Write the file, or remove it where nothing is changed.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        if not self.changes:
            self.path.unlink(missing_ok=True)
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        text = {
            "vehicle": asdict(self.vehicle),
            "written": self.written,
            "parameters": {name: asdict(change) for name, change in self.changes.items()},
        }
        draft = self.path.with_suffix(".part")
        with draft.open("w", encoding="utf-8") as file:
            file.write(json.dumps(text, indent=1) + "\n")
            file.flush()
            os.fsync(file.fileno())
        draft.replace(self.path)

    def words(self) -> str:
        """The old values, as ``NAME = value``."""
        return ", ".join(f"{name} = {change.before:g}" for name, change in self.changes.items())


def _name(vehicle: VehicleId) -> str:
    return f"changed-parameters-{vehicle.autopilot}-{vehicle.system}"


def _candidates(vehicle: VehicleId, places: list[Path]) -> Iterator[Path]:
    name = f"{_name(vehicle)}*.json"
    for where in places:
        yield from sorted(path.absolute() for path in where.glob(name))
        yield from sorted(path.absolute() for path in where.glob(f"*/{name}"))
