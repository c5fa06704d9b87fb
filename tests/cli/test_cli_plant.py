"""Plants written on the command line."""

import numpy as np
import pytest
from command_line import found, one_clear_line, run
from deadtime import TransferFunction, delay, s
from deadtime._cli.plants import plant_from

LAGGING = "0.9/(s*(0.1*s+1))"


@pytest.mark.parametrize(
    ("text", "plant"),
    [
        (LAGGING, 0.9 / (s * (0.1 * s + 1.0))),
        (" 2*delay(0.36)/s ", 2.0 / s * delay(0.36)),
        ("1/(s + 0.5*delay(1))", 1.0 / (s + 0.5 * delay(1.0))),
        ("s**-2*(1 - +s)**3/-(s+2)**3", (1.0 - s) ** 3 / (-(s**2) * (s + 2.0) ** 3)),
        ("3e-1", TransferFunction(0.3)),
        ("2**0.5/s", np.sqrt(2.0) / s),
    ],
)
def test_the_text_is_the_formula(text, plant):
    z = np.array([0.3 + 1j, -0.5 + 4j, 2.0])
    np.testing.assert_allclose(plant_from(text)(z), plant(z), rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1/(s+x)", r"character 6, at 'x\)': 'x' is not a name"),
        ("é/s", "character 1"),
        ("1/(0*s)", "character 4.*divides by zero"),
        ("1/(s*(0.1*s+1)", "not a valid formula"),
        ("2s", "not a valid formula"),
        ("s^2", r"\*\*"),
        ("exp(-2*s)/s", r"as delay\(T\)"),
        ("delay(s)", "number of seconds"),
        ("delay(-1)/s", "number of seconds"),
        ("s**0.5", "whole"),
        ("s**s", "exponent must be a number"),
        ("0**-1", "divides by zero"),
        ("10**10**10/s", "exceeds the range"),
        ("1e999/s", "finite"),
        ("(-1)**0.5", "finite"),
        ("9" * 400, "finite"),
        ("True/s", "not allowed in a plant"),
        ("__import__('os').getcwd()", "not allowed in a plant"),
        ("s.real", "not allowed in a plant"),
        ("[s][0]", "not allowed in a plant"),
        ("(lambda: s)()", "not allowed in a plant"),
        ("((((s+1)**30)**30)**30)**30", "exceeds the range"),
        ("(" * 249 + "s" + ")" * 249, "not a valid formula"),
        ("s" * 501, "501 characters"),
        ("", "not a valid formula"),
    ],
)
def test_what_is_no_plant_is_refused_with_its_place(text, words):
    with pytest.raises(ValueError, match=words) as refused:
        plant_from(text)
    assert str(refused.value).startswith("--plant")


def test_the_plant_of_the_command_is_the_integrator_written_out():
    for command, more in (
        ("roots", ["--kp", 2]),
        ("simulate", ["--kp", 2, "--limit", 1, "--points", 11]),
        ("map", ["--shape", 5, 5]),
    ):
        own = found(command, *more, "--gain", 0.9, "--lag", 0.1, "--delay", 0.36)
        same = found(command, *more, "--plant", LAGGING, "--delay", 0.36)
        late = found(command, *more, "--plant", f"delay(0.25)*{LAGGING}", "--delay", 0.11)
        for key in {"roots", "output", "abscissa"} & set(own):
            for other in (same, late):
                np.testing.assert_allclose(
                    numbers(other[key]), numbers(own[key]), rtol=1e-9, atol=1e-12
                )


def numbers(values):
    flat = np.ravel([complex(v["re"], v["im"]) if isinstance(v, dict) else v for v in values])
    return np.array([np.nan if v is None else v for v in flat.tolist()], dtype=complex)


def test_a_gain_is_a_factor_on_the_plant():
    twice = found("roots", "--kp", 1, "--plant", LAGGING, "--gain", 2, "--delay", 0.2)
    once = found("roots", "--kp", 2, "--plant", LAGGING, "--delay", 0.2)
    assert twice["spectral_abscissa"] == pytest.approx(once["spectral_abscissa"], rel=1e-12)


def test_a_design_for_a_plant_adds_its_delay():
    options = ["--fix", "Kv=0.1", "--delay-to"]
    out = found("design", "--plant", f"{LAGGING}*delay(0.1)", "--delay", 0.2, *options, 0.3)
    assert out["delays"] == pytest.approx([0.3, 0.35, 0.4])
    own = found("design", "--gain", 0.9, "--lag", 0.1, "--delay", 0.3, *options, 0.4)
    assert out["gains"]["Kp"] == pytest.approx(own["gains"]["Kp"], rel=1e-5)


@pytest.mark.parametrize("plant", ["1.8*delay(12)/(40*s+1)", "1/(s+0.5*delay(1))"])
@pytest.mark.parametrize(
    "command",
    [
        ["roots", "--kp", 0.2],
        ["simulate", "--kp", 0.2],
        ["map", "--shape", 3, 3],
        ["design", "--controller", "P", "--objective", "abscissa", "--kp", 0.1, 1],
    ],
    ids=lambda command: command[0],
)
def test_beside_the_delay_of_a_plant_the_default_is_zero(command, plant):
    assert found(*command, "--plant", plant) == found(*command, "--plant", plant, "--delay", 0)


def test_a_delay_is_asked_for_where_there_is_none():
    for plant in ([], ["--plant", "1/(s+1)"]):
        assert "--delay is missing" in one_clear_line(run("roots", "--kp", 1, *plant))


def test_delays_inside_the_plant():
    inside = ["--kp", 0.5, "--delay", 0.2, "--plant", "1/(s+0.5*delay(1))"]
    assert found("roots", *inside)["stable"] is True
    assert found("simulate", *inside)["info"]["steady_state"] == pytest.approx(0.5)
    assert "limit=1.0" in one_clear_line(run("simulate", *inside, "--limit", 1))


def test_the_lag_is_that_of_the_integrator():
    said = one_clear_line(run("roots", "--kp", 1, "--delay", 1, "--plant", "1/s", "--lag", 0.1))
    assert "--lag" in said
