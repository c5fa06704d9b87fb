"""``deadtime estimate``: every method by name, its options, several files, and what is refused."""

import json

import deadtime as dtm
import numpy as np
import pytest
from command_line import found, one_clear_line, run
from deadtime.estimation._estimate import METHODS
from flights import flight_path

LOGGED = ["--command", "command"]
FLOWN = ["--sample-time", "0.065", "--limit", "1"]


def write(flight, path):
    columns = np.column_stack([flight.time, flight.reference, flight.output, flight.command])
    header = "time,reference,output,command"
    np.savetxt(path, columns, delimiter=",", header=header, comments="")
    return path


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Steps of one vehicle under two gains, and a pseudo-random sequence."""
    folder = tmp_path_factory.mktemp("flights")
    flown = {}
    for name, Kp in (("quick", 2.0), ("slow", 0.6)):
        loop = dtm.ControlLoop(
            dtm.Integrator(0.9), dtm.P(Kp), delay=0.36, sample_time=0.065, limit=1.0
        )
        flight = dtm.Experiment.step(8.0, rest=1.04).run(loop, noise=0.004, seed=3)
        flown[name] = write(flight, folder / f"{name}.csv")
    return flown


@pytest.mark.parametrize(
    ("method", "error"),
    [("auto", 0.005), ("frequency", 0.01), ("grid", 0.01), ("decrement", 0.06), ("gcc", 0.08)],
)
def test_a_method_by_its_name(files, method, error):
    out = found(
        "estimate", files["quick"], "--kp", 2, "--gain", 0.9, *FLOWN, *LOGGED, "--method", method
    )
    assert out["method"] == ("output_error" if method == "auto" else method)
    assert out["delay"] == pytest.approx(0.36, abs=error)


def test_every_method_is_named_in_the_help():
    told = run("estimate", "--help").stdout
    for name in ("all", "auto", *METHODS):
        assert name in told


def test_options_reach_the_methods_that_have_them(files):
    step = ["estimate", files["quick"], "--kp", 2, *FLOWN, "--method", "waveform"]
    simulated = found(*step, "--noise", "recording")
    assert simulated["noise"] == "recording"
    assert found(*step, "--noise", "loop")["delay"] != simulated["delay"]
    known = found(*step, "--noise", "recording", "--initial-output", 0.0)
    assert known["initial_output"] == 0.0
    assert known["delay"] == pytest.approx(0.36, abs=0.02)


def test_a_logged_command_is_used_and_compared(files, tmp_path):
    picture = tmp_path / "all.png"
    step = ["estimate", files["quick"], "--kp", 2, *FLOWN]
    out = found(*step, *LOGGED, "--plot", picture)
    assert {"waveform", "output_error", "decrement"} <= out["estimates"].keys()
    assert out["estimates"]["output_error"]["delay"] == pytest.approx(0.36, abs=0.005)
    assert "the fit to the logged command" in out["explanation"][0]
    assert picture.stat().st_size > 5000
    assert "output_error" not in found(*step)["estimates"]
    assert "output error" in run(*step, *LOGGED).stdout


def test_the_decay_method_is_used_where_nothing_overshoots(files):
    out = found("estimate", files["slow"], "--kp", 0.6, "--gain", 0.9, *FLOWN)
    assert out["estimates"]["decay"]["delay"] == pytest.approx(0.36, abs=0.1)
    assert "decrement" not in out["estimates"]
    assert "no overshoot" in out["refusals"]["dominant"]


def test_several_files_are_fitted_together(files, tmp_path):
    picture = tmp_path / "both.png"
    both = ["estimate", files["quick"], files["slow"], "--kp", 2, "--kp", 0.6, *FLOWN]
    out = found(*both, *LOGGED, "--plot", picture)
    assert out["method"] == "output_error"
    alone = found(
        "estimate", files["quick"], "--kp", 2, *FLOWN, *LOGGED, "--method", "output_error"
    )
    assert out["stderr"]["delay"] < alone["stderr"]["delay"]
    assert out["delay"] == pytest.approx(0.36, abs=4 * out["stderr"]["delay"])
    assert picture.stat().st_size > 5000
    assert "2 recordings together" in run(*both, "--method", "waveform").stdout
    same = ["estimate", files["quick"], files["quick"], "--kp", 2, *FLOWN]
    assert found(*same)["delay"] == pytest.approx(0.36, abs=0.02)  # one --kp for all


def test_two_real_flights_together():
    paths = [flight_path(f"ardrone2_height_step_{name}.csv") for name in ("2_4_0_25", "0_5_1_0")]
    columns = ["--time", "t_s", "--reference", "ref_m", "--output", "height_m"]
    out = found(
        "estimate", *paths, *columns, "--kp", 2.4, "--kp", 0.5, *FLOWN, "--window", 13, 25.5
    )
    assert out["delay"] == pytest.approx(0.424, abs=0.006)
    assert out["gain"] == pytest.approx(0.734, abs=0.005)


def test_a_check_prints_what_it_finds_and_fails_where_it_refuses(files):
    flown = ["estimate", files["quick"], "--kp", 2, "--check", *LOGGED]
    clean = run(*flown, *FLOWN)
    assert clean.returncode == 0
    assert clean.stdout.startswith("quick.csv: 124 rows 65 ms apart, none missing")
    assert "warning" not in clean.stdout
    assert found(*flown, *FLOWN)["recordings"][0]["law"] == "exact"
    refused = run(*flown, "--sample-time", 65, "--limit", 1)
    assert refused.returncode == 1
    assert "• refused: the rows are 0.065 apart" in refused.stdout
    assert refused.stderr == ""
    told = json.loads(run(*flown, "--sample-time", 65, "--json").stdout)
    assert told["refused"] is True
    assert told["recordings"][0]["findings"][0]["code"] == "time_unit"


def test_a_check_of_several_files_is_one_of_each(files):
    both = ["estimate", files["quick"], files["slow"], *LOGGED, *FLOWN, "--check"]
    told = found(*both, "--kp", 2, "--kp", 0.6)
    assert [one["law"] for one in told["recordings"]] == ["exact", "exact"]
    told = found(*both, "--kp", 2)  # one gain for all
    assert [one["law"] for one in told["recordings"]] == ["exact", "differs"]
    assert "slow.csv: 124 rows" in run(*both, "--kp", 2).stdout


def test_warnings_stand_above_the_estimates(files):
    unlimited = ["estimate", files["quick"], "--kp", 2, "--sample-time", 0.065, *LOGGED]
    for method, rest in (("output_error", "output_error: maximum likelihood"), ("all", "method")):
        printed = run(*unlimited, "--method", method)
        assert printed.returncode == 0
        assert printed.stdout.startswith("quick.csv, warning: the command stops at 1")
        assert rest in printed.stdout
        (finding,) = found(*unlimited, "--method", method)["findings"]
        assert (finding["code"], finding["severity"]) == ("limit_seen", "warning")
        assert found(*unlimited, "--limit", 1, "--method", method)["findings"] == []
    assert "warning" not in run(*unlimited, "--limit", 1, "--method", "output_error").stdout


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--kp", 2, "--method", "guess"], "not one of all, auto, output_error"),
        (["--kp", 2, "--kp", 3], "1 file and 2 of --kp"),
        (["--kp", 2, "--noise", "loop"], "--noise is for one method"),
        (["--kp", 2, "--initial-output", 0], "--initial-output is for one method"),
        (
            ["--kp", 2, "--method", "gcc", "--noise", "loop"],
            "--noise is not an option of --method gcc",
        ),
        (
            ["--kp", 2, "--method", "output_error", "--map", "exact"],
            "--map is not an option of --method output_error",
        ),
        (["--kp", 2, "--method", "cta"], "continuous loops"),
        (["--kp", 2, "--method", "relay"], "no limit cycle"),
        (["--kp", 2, "--method", "decrement", "--free", "delay,lag"], "fix the lag"),
    ],
)
def test_invalid_combinations_of_options(files, more, words):
    assert words in one_clear_line(run("estimate", files["quick"], *FLOWN, *more))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--method", "all"], "by --method output_error or waveform"),
        (["--method", "overshoot"], "takes one recording, not 2"),
        (["--kp", 1, "--kp", 3], "2 files and 3 of --kp"),
    ],
)
def test_invalid_combinations_of_options_for_several_files(files, more, words):
    both = ["estimate", files["quick"], files["slow"], "--kp", 2, *FLOWN]
    assert words in one_clear_line(run(*both, *more))


def test_a_reference_equal_to_the_output_is_refused(tmp_path):
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065)
    flight = dtm.Experiment.step(8.0, rest=1.04).run(loop)
    copied = dtm.Recording(flight.time, flight.output, flight.output, flight.command)
    file = write(copied, tmp_path / "copied.csv")
    said = one_clear_line(run("estimate", file, "--kp", 2, "--sample-time", 0.065))
    assert "reference" in said
