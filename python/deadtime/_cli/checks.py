"""What the checks of recordings have found, as text and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from deadtime._cli.show import print_json, print_points, print_text
from deadtime.recordings import RecordingCheck


def show_checks(files: Sequence[Path], checks: Sequence[RecordingCheck], as_json: bool) -> None:
    """Print everything that was found in each file."""
    if as_json:
        found = [
            {"file": file, **check.to_dict()} for file, check in zip(files, checks, strict=True)
        ]
        print_json(
            "check", {"refused": any(check.refused for check in checks), "recordings": found}
        )
        return
    for file, check in zip(files, checks, strict=True):
        described, *findings = check.summary().splitlines()
        print_text(f"{file.name}: {described}")
        print_points(findings)


def grave_findings(files: Sequence[Path], checks: Sequence[RecordingCheck]) -> list[dict[str, Any]]:
    """All findings but notes, with their files."""
    return [
        {"file": file, **finding}
        for file, check in zip(files, checks, strict=True)
        for finding in check.to_dict()["findings"]
        if finding["severity"] != "note"
    ]


def print_grave_findings(findings: Sequence[dict[str, Any]]) -> None:
    """Print each in a line."""
    for finding in findings:
        print_text("{file.name}, {severity}: {message}".format(**finding), "yellow")
    if findings:
        print_text("--check shows the effect on the delay", "dim")
