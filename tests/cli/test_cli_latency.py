"""``deadtime latency``: how long the loops in a log take: a table, each in full, JSON, a page."""

import os
import signal
import subprocess
import sys
import time

import bags
import deadtime as dtm
import numpy as np
import pytest
from command_line import found, one_clear_line, run
from made_logs import copter, flown_copter

START = [sys.executable, "-c", "from deadtime._cli import main; main()", "latency"]
ALONE = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "NO_COLOR": "1"}


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "flight.bin"
    path.write_bytes(flown_copter(seconds=4.0).data)
    return path


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A table of a process with a delay of 0.5 s and a lag of 1 s: its columns have odd names."""
    at = np.arange(0.0, 40.0, 0.1)
    valve = np.sign(np.sin(0.7 * at)) + 0.5 * np.sign(np.sin(0.23 * at))
    plant = dtm.FactoredPlant([1.0]).transfer_function() * dtm.delay(0.5)
    level = np.ravel(plant.simulate(at, valve).outputs)
    level = level + 0.01 * np.random.default_rng(3).standard_normal(at.size)
    path = tmp_path_factory.mktemp("table") / "tank.csv"
    rows = "\n".join(f"{a:.1f},{u},{y:.5f}" for a, u, y in zip(at, valve, level, strict=True))
    path.write_text(f"hours,inflow,level_now\n{rows}\n")
    return path


def test_the_command_prints_the_table_of_the_summary(log):
    result = run("latency", log)
    assert result.returncode == 0, result.stderr
    assert result.stdout.split() == dtm.latency(log).summary().split()
    lines = result.stdout.splitlines()
    assert lines[0].startswith("flight.bin: ArduPilot Copter")
    head = lines.index(next(line for line in lines if line.startswith("loop ")))
    assert [line.split()[:3] for line in lines[head + 1 : head + 3]] == [
        ["roll", "rate", "setpoint"],
        ["roll", "rate", "actuator"],
    ]
    assert "gyro low-pass" not in result.stdout  # that is for --verbose


def test_a_loop_in_full_and_all_in_full(log):
    result = run("latency", log, "--loop", "roll rate")
    assert "seen in" in result.stdout
    for words in ("dead time", "cross-correlation: ", "for the fit", "gyro low-pass: 11.25 ms"):
        assert words in result.stdout, words
    assert "\nloop " not in result.stdout
    everything = run("latency", log, "--verbose").stdout
    assert "\nloop " in everything
    assert "cross-correlation: " in everything


def test_the_page_has_the_table_and_the_moves(log, tmp_path):
    result = run("latency", log, "--out", tmp_path / "page.html")
    assert result.returncode == 0, result.stderr
    assert "page.html" in result.stdout
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert text.index("How long each loop") < text.index("Roll rate, setpoint to response")
    assert text.count("<td>setpoint</td>") == 1
    assert text.count("<details>") >= 3
    assert "--verbose" not in text


def test_json_and_two_logs(log):
    told = found("latency", log, log, "--loop", "roll rate")
    for one in told["logs"]:
        assert [loop["command"] for loop in one["loops"]] == ["setpoint", "actuator"]
        assert {"text", "page"} == set().union(*one["advice"]) or not one["advice"]
    assert len(told["logs"]) == 2
    assert all(one["change"] == 0.0 for one in told["changes"])


def test_any_table_by_the_names_of_its_columns(table):
    columns = ("--time", "hours", "--command", "inflow", "--output", "level_now")
    (one,) = found("latency", table, *columns)["loops"]
    assert one["command"] == "actuator"
    assert one["verdict"] != "none"
    assert one["time"] == pytest.approx(1.5, rel=0.25)


def test_columns_of_usual_names_need_not_be_named(table, tmp_path):
    usual = tmp_path / "usual.csv"
    usual.write_text(table.read_text().replace("hours,inflow,level_now", "t,u,y"))
    named = run("latency", table, "--time", "hours", "--command", "inflow", "--output", "level_now")
    assert run("latency", usual).stdout.split()[-8:] == named.stdout.split()[-8:]
    followed = tmp_path / "followed.csv"
    followed.write_text(table.read_text().replace("hours,inflow,level_now", "t,asked,y"))
    (one,) = found("latency", followed, "--reference", "asked")["loops"]
    assert one["command"] == "setpoint"


def test_an_error_lists_what_exists(table, log, tmp_path):
    said = one_clear_line(run("latency", table, "--time", "hours", "--output", "level_now"))
    assert "'inflow'" in said
    assert "--command" in said
    said = one_clear_line(
        run("latency", table, "--time", "hours", "--command", "in", "--output", "level_now")
    )
    assert "inflow" in said
    bag = tmp_path / "drive.mcap"
    bag.write_bytes(bags.mcap("none", seconds=4.0))
    said = one_clear_line(run("latency", bag))
    assert "/cmd_vel:linear.x" in said
    assert "--time" in one_clear_line(run("latency", log, "--time", "t"))
    assert "has only one loop" in one_clear_line(
        run("latency", table, "--time", "hours", "--command", "inflow", "--output", "level_now",
            "--axis", "roll")
    )  # fmt: skip


def test_two_fields_of_a_bag(tmp_path):
    bag = tmp_path / "drive.mcap"
    bag.write_bytes(bags.mcap("none"))
    fields = ("--command", "/cmd_vel:linear.x", "--output", "/state:speed")
    (one,) = found("latency", bag, *fields)["loops"]
    assert one["time"] == pytest.approx(bags.DELAY + bags.LAG, rel=0.2)
    said = one_clear_line(run("latency", bag, fields[0], "/cmd_vel:linear.q", *fields[2:]))
    assert "linear.x" in said


def test_what_is_wrong_is_one_line(log):
    assert "no loop with the axis 'yaw'" in one_clear_line(run("latency", log, "--axis", "yaw"))
    assert "give one log, or two" in one_clear_line(run("latency", log, log, log))
    assert "page about one log" in one_clear_line(run("latency", log, log, "--out", "page.html"))


def test_a_log_of_an_instant_is_answered_by_one_line(tmp_path):
    # 32 ms of a log were answered by a line for each of six loops.
    path = tmp_path / "flight.bin"
    path.write_bytes(copter(rows=3, period=0.016).data)
    result = run("latency", path)
    assert result.returncode == 3
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    assert "none: flight.bin lasts only 42 ms" in result.stderr


def test_a_log_at_rest_has_no_time(tmp_path):
    path = tmp_path / "flight.bin"
    path.write_bytes(flown_copter(seconds=3.0, steps=False).data)
    result = run("latency", path)
    assert result.returncode == 3
    assert "none: roll rate: " in result.stdout


def test_rows_are_in_a_pipe_as_soon_as_they_are_found(log):
    with subprocess.Popen([*START, str(log)], stdout=subprocess.PIPE, env=ALONE) as running:
        assert running.stdout is not None
        early = [running.stdout.readline() for _ in range(3)]
        assert early[2].startswith(b"loop ")
        assert running.poll() is None  # it estimates still
        rest = running.stdout.read()
    assert rest.count(b"roll rate") >= 2


@pytest.mark.usefixtures("listens_to_ctrl_c")
def test_a_reader_may_close_the_pipe_and_ctrl_c_ends(log):
    with subprocess.Popen(
        [*START, str(log)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=ALONE
    ) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        running.stdout.readline()
        running.stdout.close()
        assert b"Traceback" not in running.stderr.read()
    with subprocess.Popen(
        [*START, str(log)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=ALONE
    ) as running:
        assert running.stdout is not None
        for _ in range(3):
            running.stdout.readline()
        running.send_signal(signal.SIGINT)
        begun = time.monotonic()
        _, said = running.communicate(timeout=60.0)
        assert (running.returncode, said.strip()) == (130, b"deadtime: interrupted")
        assert time.monotonic() - begun < 20.0
