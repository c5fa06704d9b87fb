"""``deadtime estimate --plant auto``, and plants with several lags on the command line."""

import deadtime as dtm
import numpy as np
import pytest
from command_line import found, one_clear_line, run
from deadtime._cli.plants import plant_from, with_names
from vehicles import record_attitude

TOLD = ("--kp", 1, "--sample-time", 0.02, "--command", "reference")


@pytest.fixture(scope="module")
def roll(tmp_path_factory):
    path = tmp_path_factory.mktemp("roll") / "roll.csv"
    recording = record_attitude(2, rows=150, delay=0.047, lags=(0.15, 0.05), gain=0.95)
    columns = np.stack([recording.time, recording.reference, recording.output], axis=1)
    np.savetxt(path, columns, delimiter=",", header="time,reference,output", comments="")
    return str(path)


def test_the_table_shows_the_evidence_and_the_estimate_follows(roll):
    result = run(
        "estimate",
        roll,
        *TOLD,
        "--plant",
        "auto",
    )
    assert result.returncode == 0, result.stderr
    for words in (
        "2 lags *",
        "BIC",
        "white",
        "reliable",
        "delay+lag",
        "over all plants",
        "further lag below",
    ):
        assert words in result.stdout
    # The columns once had the headings of the table of methods.
    assert ["plant", "BIC"] in [line.split()[:2] for line in result.stdout.splitlines()]


def test_a_formula_with_two_lags_has_a_name_for_each(roll):
    out = found(
        "estimate",
        roll,
        *TOLD,
        "--plant",
        "0.9/((0.1*s+1)*(0.2*s+1))",
        "--method",
        "output_error",
        "--free",
        "delay,gain,lag_1,lag_2",
    )
    low, high = out["interval_95"]["delay+lag"]
    assert low < 0.247 < high
    assert out["unseen_lag"] > 0.0


@pytest.mark.parametrize(
    ("formula", "parameters"),
    [
        ("3*(0.1*s+1)/((0.2*s+1)*(s+2))", {"gain": 1.5, "lag_1": 0.5, "lag_2": 0.2, "zero": 0.1}),
        ("1/(s*(0.1*s+1)**2)", {"gain": 1.0, "lag_1": 0.1, "lag_2": 0.1, "zero": 0.0}),
        (
            "1/(s**2+0.1*s+1)",
            {"gain": 1.0, "zero": 0.0, "pole_frequency": 1.0, "pole_damping": 0.05},
        ),
        ("1/((s**2+0.1*s+1)*(s**2+s+4))", {"gain": 1.0}),
        ("1/((s-1)*(s+2))", {"gain": 1.0}),
        ("s/((s+1)*(s+2))", {"gain": 1.0}),
    ],
)
def test_poles_and_a_zero_get_names_where_a_plant_has_few(formula, parameters):
    plant = with_names(dtm.ControlLoop(plant_from(formula), dtm.P(1.0)).plant)
    assert plant.parameters == pytest.approx(parameters, rel=1e-5)


@pytest.mark.parametrize("option", [["--free", "delay"], ["--method", "all"]])
def test_what_a_choice_does_not_take_is_refused(roll, option):
    result = run("estimate", roll, "--kp", 1, "--plant", "auto/s", *option)
    assert "one method fits all parameters of the plant" in one_clear_line(result)
