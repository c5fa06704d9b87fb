"""``deadtime inspect``: what a log holds, as text and as JSON."""

import re

import pytest
from command_line import found, one_clear_line, run
from made_logs import DataFlash, copter, flown_copter


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "flight.bin"
    path.write_bytes(copter().data)
    return path


def test_the_log_as_text(log, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    result = run("inspect", log)
    assert result.returncode == 0
    for words in (
        "flight.bin: DataFlash of ArduPilot Copter (QUAD/X), 3.99 s",
        "ALT_HOLD from 0.00 s",
        "ATT.DesRoll",
        "ATC_RAT_RLL_P 0.135",
    ):
        assert words in result.stdout, words


def test_the_log_as_json(log):
    told = found("inspect", log)
    assert told["autopilot"] == "ArduPilot"
    assert told["parameters"]["BATT_CAPACITY"] == 5000.0
    roll, pitch = told["loops"]
    assert (roll["name"], pitch["name"]) == ("roll", "pitch")
    assert roll["signals"]["setpoint"]["conversion"] == "ATT.DesRoll [deg] to rad"
    assert roll["signals"]["setpoint"]["rate"] == pytest.approx(50.0)
    assert roll["segments"] == [[pytest.approx(0.009, abs=0.01), pytest.approx(3.98, abs=0.02)]]


def test_one_loop(log):
    result = run("inspect", log, "--loop", "roll")
    assert result.returncode == 0
    assert "converted: ATT.Roll [deg] to rad" in result.stdout
    assert "pitch" not in result.stdout
    assert found("inspect", log, "--loop", "pitch")["axis"] == "pitch"


def test_what_is_wrong_is_one_line(log, tmp_path):
    assert "Its loops are roll, pitch" in one_clear_line(run("inspect", log, "--loop", "yaw"))
    assert "does not exist" in one_clear_line(run("inspect", tmp_path / "no.ulg"))
    text = tmp_path / "flight.csv"
    text.write_text("time,reference\n")
    assert "open it with dtm.read_recording" in one_clear_line(run("inspect", text))


def test_a_flight_of_a_log_with_one_is_refused(log):
    result = run("inspect", log, "--flight", 2)
    assert result.returncode != 0
    assert "DataFlash log, which contains only one flight" in one_clear_line(result)


@pytest.mark.parametrize("more", [[], ["--json"]])
def test_a_log_without_a_loop_is_no_answer(more, tmp_path):
    log = DataFlash()
    log.define("IMU", 9, "Qf", "TimeUS,GyrX")
    for k in range(20):
        log.add("IMU", 20_000 * k, 0.1)
    path = tmp_path / "flight.bin"
    path.write_bytes(log.data)
    assert run("inspect", path, *more).returncode == 3


def test_one_screen_tells_filters_their_sum_and_what_the_rows_tell(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    path = tmp_path / "flight.bin"
    path.write_bytes(flown_copter(seconds=6.0).data)
    printed = run("inspect", path).stdout
    assert "with these rows" in printed
    assert "± " in next(line for line in printed.splitlines() if " roll rate " in line)
    assert "gyro low-pass: 11.25 ms (INS_GYRO_FILTER 20)" in printed
    assert "gyro path together: 11.25 ms (1 filter)" in printed
    assert len(printed.splitlines()) <= 24


def test_many_parameters_are_counted(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    log = flown_copter(seconds=3.0)
    for axis in ("RLL", "PIT", "YAW"):
        for gain in "PID":
            log.add("PARM", 0, f"ATC_RAT_{axis}_{gain}", 0.135)
    path = tmp_path / "flight.bin"
    path.write_bytes(log.data)
    printed = " ".join(run("inspect", path).stdout.split())
    counted = re.search(r"parameters: (.*) and (\d+) more: --json", printed)
    assert counted is not None
    assert len(counted[1]) <= 160
    assert int(counted[2]) + counted[1].count(",") + 1 == 11
