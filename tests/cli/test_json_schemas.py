"""Every command prints the keys that the page on JSON names for its schema."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import bags
import deadtime as dtm
import numpy as np
import pytest
from command_line import found
from made_logs import copter, flown_copter

NO_BAGS: dict[str, Any] = {
    "condition": find_spec("mcap_ros2") is None,
    "reason": "mcap-ros2-support reads MCAP files",
}
REFERENCE = Path(__file__).resolve().parents[2] / "docs/reference"
PAGES = (REFERENCE / "json.md", REFERENCE / "json-vehicles.md")


def documented() -> dict[str, set[str]]:
    """The keys of each schema in the tables of the pages."""
    keys = {}
    for page in PAGES:
        sections = re.split(r"^## `(.+)`$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
        for schema, text in zip(sections[1::2], sections[2::2], strict=True):
            cells = re.findall(r"^\| (`[^|]+) \|", text, flags=re.MULTILINE)
            keys[schema] = {key for cell in cells for key in re.findall(r"`(\w+)`", cell)}
    return keys


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("json")
    time = 0.065 * np.arange(120)
    reference = np.where(time >= 0.65, 1.0, 0.0)
    loop = dtm.ControlLoop(dtm.Integrator(0.9), dtm.P(2.4), delay=0.3, sample_time=0.065)
    noise = np.random.default_rng(1).normal(0.0, 0.005, time.size)
    output = loop.simulate(time, reference).outputs + noise
    table = np.column_stack([time, reference, output])
    np.savetxt(
        place / "step.csv", table, delimiter=",", header="time,reference,output", comments=""
    )
    command = np.where(np.sin(time) > 0.0, 0.5, -0.5)
    moved = np.cumsum(np.roll(command, 5)) * 0.065 + noise
    table = np.column_stack([time, moved, command])
    np.savetxt(place / "moved.csv", table, delimiter=",", header="time,output,command", comments="")
    (place / "flight.bin").write_bytes(copter().data)
    if not NO_BAGS["condition"]:
        (place / "drive.mcap").write_bytes(bags.mcap_json(seconds=2.0))
    (place / "flown.bin").write_bytes(flown_copter(seconds=3.0, rate=100).data)
    return place


LOOP = ("step.csv", "--kp", 2.4, "--sample-time", 0.065)
STEP = ("estimate", *LOOP)
CONTINUOUS = ("estimate", "step.csv", "--kp", 2.4)


@pytest.mark.parametrize(
    ("schema", "command"),
    [
        ("roots", ("roots", "--kp", 2, "--delay", 0.3)),
        ("map", ("map", "--delay", 0.36, "--shape", 9, 9)),
        ("design", ("design", "--delay", 0.3, "--controller", "P")),
        ("simulate", ("simulate", "--kp", 1, "--delay", 0.3)),
        ("explore", ("explore", "--out", "page.html")),
        ("watch", ("watch", "moved.csv", "--noise", 0.005)),
        ("report", ("report", *LOOP, "--out", "pages/report.html")),
        ("plant-estimate", ("estimate", "moved.csv")),
        ("tune", ("tune", "moved.csv", "--controller", "P")),
        ("estimate", (*CONTINUOUS, "--method", "auto")),
        ("comparison", (*STEP, "--method", "all")),
        ("plant-choice", (*CONTINUOUS, "--plant", "auto/s")),
        ("check", (*STEP, "--check")),
        ("log", ("inspect", "flight.bin")),
        ("log-loop", ("inspect", "flight.bin", "--loop", "roll")),
        pytest.param("bag", ("inspect", "drive.mcap"), marks=pytest.mark.skipif(**NO_BAGS)),
        ("latency", ("latency", "flown.bin", "--loop", "roll rate")),
        ("latency-change", ("latency", "flown.bin", "flown.bin", "--loop", "roll rate")),
        ("reproduction", ("reproduce", "--only", "figure9")),
    ],
)
def test_the_page_names_what_is_printed(
    folder: Path, schema: str, command: tuple[object, ...]
) -> None:
    check_keys(found(*command, cwd=folder), schema)


def test_the_demo_recovers_the_truth(tmp_path: Path) -> None:
    printed = found("demo", "--folder", "demo", "--seed", 3, cwd=tmp_path)
    check_keys(printed, "demo")
    truth, fit = printed["truth"], printed["estimates"]["waveform with lag"]
    assert fit["delay_plus_lag"] == pytest.approx(truth["delay+lag"], abs=0.02)
    assert fit["gain"] == pytest.approx(truth["gain"], abs=0.05)


def check_keys(printed: dict[str, Any], schema: str) -> None:
    name = printed.pop("schema")
    assert name == f"deadtime.{schema}/1"
    assert set(printed) <= documented()[name]
    optional = {"noise", "link", "no_interval_because"}
    assert documented()[name] - set(printed) <= optional
    heads = [page.read_text(encoding="utf-8").split("\n## ")[0] for page in PAGES]
    assert any(f"`{name}`" in head for head in heads)
