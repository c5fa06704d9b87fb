"""The command `deadtime map` with all its options."""

import math

import deadtime as dtm
import numpy as np
import pytest
from command_line import found, one_clear_line, run

SMALL = ["--delay", 0.36, "--shape", 31, 21]


def test_counts_alone_are_those_of_the_full_map():
    full, counts = found("map", *SMALL), found("map", *SMALL, "--counts")
    assert counts["unstable"] == full["unstable"]
    assert counts["abscissa"] is None
    assert counts["best"] is None
    assert counts["best_delay_margin"] is None
    assert found("map", *SMALL, "--counts", "--proof", "cells")["unstable"] == full["unstable"]


def test_boundaries_with_frequency_and_direction():
    out = found("map", *SMALL, "--counts", "--kp", 0.1, 6)
    for curve in out["boundaries"]:
        omega = np.array(curve["omega"])
        assert np.array(curve["Kp"]) == pytest.approx(omega * np.sin(0.36 * omega), rel=1e-9)
        assert np.array(curve["Kv"]) == pytest.approx(-np.cos(0.36 * omega), abs=1e-9)
        assert set(curve["crossing"]) <= {-2, 2}
    # Most curves are solved for one gain; what runs along its rows is solved for the other.
    assert {curve["along"] for curve in out["boundaries"]} <= {"Kp", "Kv"}
    assert out["boundaries"][0]["along"] == "Kp"


def test_the_delay_margin_of_the_best_cell():
    out = found("map", *SMALL)
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(**out["best"]), delay=0.36)
    assert out["best_delay_margin"] == loop.margin().delay_margin
    printed = run("map", *SMALL).stdout
    assert f"and delay margin {out['best_delay_margin']:.4g} s" in printed
    assert "boundary of" in printed


def test_decay_and_damping_leave_fewer_stable_cells():
    plain, slow, damped = (
        found("map", *SMALL, "--counts", *more)
        for more in ([], ["--decay", 1.0], ["--damping", 0.4, 6.0])
    )
    stable = [np.array(out["unstable"]) == 0 for out in (plain, slow, damped)]
    assert stable[0].sum() > stable[1].sum() > 0
    assert stable[0].sum() > stable[2].sum() > 0
    assert not (stable[1] & ~stable[0]).any()


def test_crossings_along_one_gain():
    out = found("map", *SMALL, "--counts", "--along", "Kp", "--at", 0)["crossings"]
    assert out["values"] == pytest.approx([0.0, 0.5 * math.pi / 0.36], abs=1e-12)
    assert out["direction"] == [-1, 2]
    assert out["counts"][1:] == [0, 2]
    best = found("map", *SMALL, "--along", "Kv", "--kv", -0.9, 0.9)
    below = sum(value < best["best"]["Kv"] for value in best["crossings"]["values"])
    assert best["crossings"]["counts"][below] == 0
    printed = run("map", *SMALL, "--counts", "--along", "Kp", "--at", 0).stdout
    assert "4.363323" in printed
    assert "+2" in printed


def test_a_sampled_map_has_cells_a_margin_and_curves():
    out = found("map", *SMALL, "--sample-time", 0.065, "--damping", 0.1, 5)
    assert max(len(curve["omega"]) for curve in out["boundaries"]) > 10
    assert 0 < out["best_delay_margin"] < 1


@pytest.mark.parametrize("more", [["--counts"], ["--decay", 1]])
def test_pictures(tmp_path, more):
    picture = tmp_path / "map.png"
    result = run("map", *SMALL, *more, "--plot", picture)
    assert result.returncode == 0, result.stderr
    assert picture.stat().st_size > 1000


def test_a_gain_is_listed_where_no_chains_reach_the_axis():
    """The whole range was refused once because chains are unstable in a part of it."""
    result = run("map", *SMALL, "--along", "Kv", "--at", "1")
    assert result.returncode == 0
    assert "not listed" in result.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--decay", "nan"], "decay"),
        (["--damping", "2", "5"], "damping"),
        (["--along", "Kp", "--counts"], "--at"),
        (["--along", "Kd"], "Kd"),
        (["--along", "Kp", "--at", "nan"], "nan"),
        (["--along", "Kp", "--at", "0", "--sample-time", "0.1"], "sample_time"),
        (["--proof", "none"], "none"),
    ],
)
def test_what_cannot_be_mapped(arguments, words):
    assert words in one_clear_line(run("map", *SMALL, *arguments))
