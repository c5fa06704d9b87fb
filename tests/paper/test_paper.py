"""The reproduced paper: verdicts from digits, numbers against a list made otherwise."""

import ast
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import deadtime as dtm
import numpy as np
import pytest
from browser import check_page
from command_line import found as run_json, one_clear_line, run
from deadtime import paper
from deadtime.estimation import Overshoot
from deadtime.paper import Comparison, Verdict, agreeing_digits, printed_digits
from deadtime.paper._page import render_reproduction, write_reproduction
from hypothesis import given, strategies as st
from scipy.optimize import brentq

ROOT = Path(__file__).resolve().parents[2]
PAPER = ROOT / "python" / "deadtime" / "paper"
LIST = json.loads((ROOT / "tests" / "reference" / "paper_numbers.json").read_text("utf-8"))

# No number, but slips of the typesetting.
NO_NUMBER = {"Eqs"}
# Two numbers in one entry of the list.
PARTED = {"Td 0.37 / 0.36": ("Td 0.37 (numerical)", "Td 0.36 (analytical)")}
ENTRIES = [entry for entry in LIST["entries"] if entry["where"] not in NO_NUMBER]
each_entry = pytest.mark.parametrize(
    "entry", ENTRIES, ids=lambda entry: f"{entry['where']} {entry['quantity']}"
)


@pytest.fixture(scope="module")
def found():
    return paper.reproduce()


@pytest.fixture(scope="module")
def ours(found):
    return {(one.where, one.quantity): one for one in found.comparisons}


# Verdicts


@pytest.mark.parametrize(
    ("printed", "computed", "digits"),
    [
        ("2.300", 2.29962, 4),
        ("-3.323", -3.3168, 3),
        ("0.97", 0.9685, 2),
        ("0.3", 0.2415, 0),
        ("0.09", 0.0918, 1),
        ("0.000", 4e-4, 3),
        ("0.000", 6e-4, 0),
        ("-0.93", 0.93, 0),
        ("19", 15.708, 1),
        ("75", 1e-300, 0),
    ],
)
def test_agreeing_digits(printed, computed, digits):
    assert agreeing_digits(printed, computed) == digits


@given(st.floats(1e-6, 1e6), st.integers(0, 5))
def test_a_number_printed_with_any_digits_is_reproduced_by_itself(value, decimals):
    printed = f"{value:.{decimals}f}"
    assert agreeing_digits(printed, float(printed)) == printed_digits(printed)


@given(st.integers(1000, 9999), st.integers(1, 4))
def test_a_digit_that_differs_is_found(number, place):
    # The digit at `place` moved by two: those before it may carry over, but no more agree.
    other = number + 2 * 10 ** (4 - place)
    assert agreeing_digits(str(number), other) < place


@pytest.mark.parametrize(
    ("printed", "computed", "verdict"),
    [
        ("0.3682", 0.368199, Verdict.EXACT),
        ("0.3682", 0.3679, Verdict.PARTLY),
        ("0.3682", 0.41, Verdict.DIFFERENT),
    ],
)
def test_verdicts_of_numbers(printed, computed, verdict):
    assert Comparison.of_number("here", "x", printed, computed, "").verdict is verdict


def test_a_pair_is_as_good_as_its_worse_part():
    good = Comparison.of_root("here", "s", ("-0.93", "7.71"), -0.9262 - 7.7133j, "")
    bad = Comparison.of_root("here", "s", ("-4.4", "11.8"), -4.2871 + 11.7362j, "")
    assert good.verdict is Verdict.EXACT
    assert good.computed.imag > 0
    assert bad.verdict is Verdict.DIFFERENT


# The list


def test_every_entry_of_the_list_is_covered(ours):
    wanted = [
        (entry["where"], name)
        for entry in ENTRIES
        for name in PARTED.get(entry["quantity"], (entry["quantity"],))
    ]
    assert not [key for key in wanted if key not in ours]


def number_of(words):
    return complex(words.replace("+-", "+").replace("i", "j").replace(" ", ""))


@pytest.mark.parametrize(
    "entry", ENTRIES, ids=lambda entry: f"{entry['where']} {entry['quantity']}"
)
def test_numbers_agree_with_the_list(entry, ours):
    if entry["quantity"] in PARTED:
        return  # both numbers are in the sections before
    one = ours[entry["where"], entry["quantity"]]
    if isinstance(entry["printed"], float | int):
        assert float(one.printed) == entry["printed"]
    computed = entry["computed"]
    if isinstance(computed, dict):
        for name, value in computed.items():
            assert one.details[name] == pytest.approx(value, abs=6e-6)
    elif isinstance(computed, float | int):
        digits = len(repr(computed).partition(".")[2])
        assert one.computed == pytest.approx(computed, abs=0.51 * 10.0**-digits)
    elif isinstance(computed, str) and re.fullmatch(r"-?[\d.]+\+-?[\d.]+i", computed):
        assert abs(one.computed - number_of(computed)) < 1e-4
    # Everything else is words, and its numbers are in the tests below.


GOOD = {Verdict.EXACT, Verdict.PARTLY, Verdict.CONFIRMED}
BAD = {Verdict.DIFFERENT, Verdict.CONTRADICTED}


@pytest.mark.parametrize(
    "entry", ENTRIES, ids=lambda entry: f"{entry['where']} {entry['quantity']}"
)
def test_verdicts_agree_with_the_list(entry, ours):
    words = entry["verdict"]
    for name in PARTED.get(entry["quantity"], (entry["quantity"],)):
        verdict = ours[entry["where"], name].verdict
        if words.startswith("measured"):
            assert verdict is Verdict.MEASURED
        elif words.startswith(("reproduced", "conversion right")):
            assert verdict in GOOD
        else:
            assert verdict in BAD


# Other ways to the same numbers


def test_overshoots_and_delays_in_closed_form(found):
    # K Td >= 1: the overshoot is K Td - 1/2. At K = 10 that is 75 %.
    rows = {row.gain: row for row in found.parts["table1"].rows}
    assert rows[10].exact_delay == pytest.approx(0.125, abs=1e-9)
    for row in rows.values():
        x = row.gain * row.exact_delay
        if 2 - math.sqrt(2) <= x <= 1:
            w = 1 - math.sqrt(2 * x - 1)
            part = 2 * x - x**2 / 2 + (1 - x) * w - w**2 / 2 + w**3 / 6 - 1
            assert 100 * part == pytest.approx(row.overshoot, abs=1e-6)
        # Eqs. 3 and 6 solved by the angle of the root: s Td = -rho e^(-i phi).
        phi = math.acos(row.damping)
        rho = phi / math.sin(phi)
        assert row.delay * row.gain == pytest.approx(rho * math.exp(-rho * row.damping), abs=1e-12)


def test_table_2_exactly_and_coarsely(found):
    rows = found.parts["table2"].rows
    converged = [0.0, 0.3977, 2.0381, 2.2722, 2.2745, 2.2797, 2.4079]
    assert [row.exact for row in rows] == pytest.approx(converged, abs=6e-5)
    assert [round(row.coarse, 3) for row in rows] == [row.printed for row in rows]


def test_the_parts_of_the_gap_are_the_gap(found):
    gap = found.parts["gap"]
    in_ms = {name: 1e3 * value for name, value in gap.parts.items()}
    assert in_ms["saturation"] == pytest.approx(9.907, abs=2e-3)
    assert in_ms["dominant root"] == pytest.approx(-1.081, abs=2e-3)
    assert in_ms["coarse steps"] == pytest.approx(-0.444, abs=2e-3)
    assert sum(in_ms.values()) == pytest.approx(1e3 * (gap.simulation - gap.dominant), abs=1e-9)
    # The exact saturated delay by fine fixed steps of another solver.
    loop = paper.altitude_loop(gap.saturated)
    fine = dtm.simulate_fixed_step(loop, 4.0, step=2e-4, solver="ode4")
    assert 100 * (fine.outputs.max() - 1) == pytest.approx(2.30, abs=1e-4)


def test_figure_3(found):
    figure = found.parts["figure3"]
    assert figure.limit == pytest.approx(math.pi / 0.2, rel=1e-9)
    assert figure.coarse_limits[0.001] == pytest.approx(figure.limit, abs=1e-2)
    assert 18 < figure.coarse_limits[0.08] < 19
    assert figure.held_limit == pytest.approx(12.46, abs=5e-3)


def test_figure_10(found):
    figure = found.parts["figure10"]
    for curve, filtered in ((figure.ideal, False), (figure.filtered, True)):
        for gain, root in curve.roots.items():
            smooth = 38.0**2 / (root + 38.0) ** 2 if filtered else 1.0
            h = root + (2.0 + gain * root * smooth) * np.exp(-0.36 * root)
            assert abs(h) < 1e-9 * abs(root)
        near = [paper.velocity_loop(curve.best + d, filtered) for d in (-1e-3, 1e-3)]
        assert all(loop.spectral_abscissa() > curve.best_abscissa for loop in near)
        edge = [paper.velocity_loop(curve.critical * f, filtered) for f in (0.9999, 1.0001)]
        assert [loop.is_stable() for loop in edge] == [True, False]
    assert figure.ideal.best == pytest.approx(0.2415, abs=5e-4)
    assert figure.ideal.best_abscissa == pytest.approx(-3.6841, abs=1e-4)
    assert figure.filtered.best == pytest.approx(0.190, abs=1e-3)
    assert figure.filtered.best_abscissa == pytest.approx(-2.645, abs=5e-4)
    assert figure.filtered.critical == pytest.approx(0.8904, abs=5e-5)
    assert figure.filtered.roots[0.3] == pytest.approx(-2.197 + 5.578j, abs=1e-3)


def settles(Kv, band, step=2e-4, end=6.0):
    """Settling time from the start of the motion by Euler's method, written out."""
    late, count = round(0.36 / step), round(end / step)
    z, slow, slower, command = [0.0], 0.0, 0.0, []
    for k in range(count):
        velocity = 38.0 * (slow - slower)
        command.append(min(1.0, max(-1.0, 2.0 * (1.0 - z[k]) - Kv * velocity)))
        slow, slower = slow + step * 38.0 * (z[k] - slow), slower + step * 38.0 * (slow - slower)
        z.append(z[k] + step * (command[k - late] if k >= late else 0.0))
    outside = np.flatnonzero(np.abs(np.array(z) - 1.0) > band)
    return (outside[-1] + 1) * step - 0.36


def test_figure_11_by_eulers_method(found):
    for one in found.parts["figure11"].settling:
        assert one.from_motion == pytest.approx(settles(one.gain, 0.02), abs=2e-3)
        assert one.wider == pytest.approx(settles(one.gain, 0.021), abs=4e-3)
    # The list has 1.685 and 2.471 s: of another filter or stepper. The second one lies where a
    # ripple of 2.02 % decides.
    first, second = found.parts["figure11"].settling
    assert first.from_motion == pytest.approx(1.685, rel=0.04)
    assert second.wider == pytest.approx(2.471, rel=0.01)


# The Internet loop


@pytest.mark.parametrize(("sample_time", "delay"), [(0.02, 0.1), (0.05, 0.113), (0.1, 0.0)])
def test_a_constant_round_trip_is_the_sampled_loop(sample_time, delay):
    trial = paper.internet_loop(7.0, delay, sample_time=sample_time, duration=3.0)
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=7.0), delay=delay, sample_time=sample_time)
    after = trial.time >= 0.0
    exact = loop.simulate(trial.time[after])
    np.testing.assert_allclose(trial.output[after], exact.outputs, rtol=0, atol=1e-12)
    np.testing.assert_allclose(trial.command[after][1:], exact.inputs[1:], rtol=0, atol=1e-11)


def test_jitter_and_loss_are_seeded_and_change_the_run():
    def run(**options):
        return paper.internet_loop(8.0, duration=2.0, **options).output

    steady = run()
    shaken = run(jitter=0.02, seed=1)
    np.testing.assert_array_equal(shaken, run(jitter=0.02, seed=1))
    assert np.abs(shaken - run(jitter=0.02, seed=2)).max() > 1e-3
    assert np.abs(shaken - steady).max() > 1e-3
    assert np.abs(run(loss=0.3, seed=1) - steady).max() > 1e-3
    assert np.abs(run(jitter=1e-9, seed=1) - steady).max() < 1e-6


def test_the_delay_of_a_trial_by_the_method_of_table_1():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=9.0), sample_time=0.002)
    trial = paper.internet_loop(9.0, 0.11, sample_time=0.002)
    fit = dtm.estimate_delay(trial, loop, method=Overshoot(map="exact"))
    # A hold acts like half its length.
    assert fit.delay == pytest.approx(0.111, abs=3e-4)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"delay": -0.1}, "delay=-0.1"),
        ({"sample_time": 0.0}, "sample_time=0.0"),
        ({"jitter": math.nan}, "jitter=nan"),
        ({"loss": 1.0}, "loss=1.0"),
        ({"duration": math.inf}, "duration=inf"),
    ],
)
def test_an_internet_loop_refuses(options, match):
    with pytest.raises(ValueError, match=match):
        paper.internet_loop(8.0, **options)


# Time scales


def test_a_delay_alone_is_its_own_time_scale():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=8.0), delay=0.1)
    found = paper.time_scale(loop)
    assert found.peak_ratio == pytest.approx(1.0, abs=1e-6)
    assert found.period_ratio == pytest.approx(1.0, abs=1e-6)
    assert found.delay_alone == pytest.approx(0.1, abs=1e-8)


def test_a_lag_stretches_and_its_roots_say_so():
    found = paper.stretch(8.0, 31.5, lag=0.1)
    h = dtm.s * (1 + 0.1 * dtm.s) + 8.0 * dtm.delay(found.delay)
    assert 2 * math.pi / abs(h.rightmost()[0].imag) == pytest.approx(found.period, rel=1e-6)
    # The delay alone: K Td from the closed form, its root by Lambert W.
    alone = brentq(
        lambda d: (
            dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=8.0), delay=d)
            .step_response()
            .info()["overshoot"]
            - 31.5
        ),
        0.06,
        0.15,
    )
    period = 2 * math.pi / abs(dtm.dde_roots(0.0, -8.0, alone).imag)
    assert found.period / period == pytest.approx(found.period_ratio, rel=1e-5)
    assert found.period_ratio > 1.4


def test_too_much_lag_leaves_no_delay():
    assert paper.stretch(5.0, 1.7, lag=0.1) is None


def test_a_loop_that_does_not_overshoot_has_no_time_scale():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1.0), delay=0.1)
    with pytest.raises(ValueError, match="overshoot"):
        paper.time_scale(loop)


def test_table_1_speaks_for_a_hold_and_against_a_lag(found):
    hold, lag, both = found.parts["figure2"].explanations
    assert hold.misfits[0] == lag.misfits[0] == pytest.approx(8.49, abs=0.02)
    assert hold.values[hold.best] == pytest.approx(0.17, abs=0.006)
    assert hold.misfits[hold.best] < 0.5 * hold.misfits[0]
    assert np.all(np.diff(lag.misfits) >= 0)
    assert both.hold == hold.values[hold.best]
    assert both.misfits[0] == pytest.approx(hold.misfits[hold.best], abs=1e-9)
    assert both.misfits.min() > 0.95 * both.misfits[0]
    assert both.misfits[-1] > 2 * both.misfits[0]
    with pytest.raises(ValueError, match=r"hold=0\.1"):
        paper.explain("hold", np.array([0.1]), hold=0.1)
    # A hold without a delay overshoots by K Ts - 1.
    explained = paper.explain("hold", np.array([0.2]))
    gains = np.arange(5.0, 11.0)
    assert explained.delays[1] < 0.01
    assert explained.overshoots[1] == pytest.approx(100 * (gains * 0.2 - 1), abs=5)


# All of it


def test_the_summary_counts_every_comparison(found):
    assert sum(found.counts().values()) == len(found.comparisons)
    numbers = [int(one) for one in re.findall(r"\d+", found.summary())]
    assert numbers[0] == sum(numbers[1:4])
    assert numbers[4] == sum(numbers[5:7])
    assert numbers[0] + numbers[4] + numbers[7] == len(found.comparisons)


def test_an_unknown_part_is_refused():
    with pytest.raises(ValueError, match="table9 cannot be reproduced: give some of table1"):
        paper.reproduce(only=["table9"])
    with pytest.raises(ValueError, match="only is empty"):
        paper.reproduce(only=[])


@pytest.mark.parametrize(
    "names", [("table1", "gap"), pytest.param(paper.PARTS, marks=pytest.mark.survey)]
)
def test_the_page_is_valid_and_fetches_nothing(found, names):
    found = replace(found, parts={name: found.parts[name] for name in names})
    page = render_reproduction(found)
    assert "<script" not in page
    # The explorer is a page of its own, in a frame.
    page, frames = re.subn(r"<iframe .*?</iframe>", "", page, flags=re.DOTALL)
    assert frames == 1
    assert page.count("<svg") == len(names)
    names = re.findall(r'\bid="([^"]+)"', page)
    assert len(names) == len(set(names)), "two parts of the page have one name"
    used = re.findall(r'(?:href="#|url\(#|aria-labelledby=")([^")]+)', page)
    assert set(used) <= set(names)
    assert 'src="' not in page
    assert found.summary() in page


@pytest.mark.survey
def test_the_page_in_a_browser(found, tmp_path):
    some = replace(found, parts={name: found.parts[name] for name in ("table1", "gap")})
    check_page(write_reproduction(some, tmp_path / "paper.html", {}))


def test_the_manual_shows_these_numbers(found):
    shown = (ROOT / "docs" / "paper/reproduction-numbers.md").read_text(encoding="utf-8")
    assert found.summary() in shown
    for one in found.comparisons:
        row = f"| {one.quantity} | {one.printed} | {one.shown} | {one.outcome} |"
        assert row.replace("<", "&lt;") in shown, "make it anew: python docs/pictures.py"


def test_only_public_names_are_used():
    """Except for drawing, pages, progress and the filter of the paper."""
    for path in PAPER.glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("deadtime"):
                inside = [part for part in node.module.split(".") if part.startswith("_")]
                public = not inside or node.module.startswith("deadtime.paper")
                helper = inside[:1] in (["_base"], ["_derivative_filter"], ["_plots"])
                assert public or helper, f"{path.name}: {node.module}"
            if (
                isinstance(node, ast.Attribute)
                and isinstance(node.value, ast.Name)
                and node.value.id == "dtm"
            ):
                assert node.attr in dtm.__all__, f"{path.name}: dtm.{node.attr}"


# The command


def test_the_command_prints_and_writes(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    only = ("--only", "table2,gap,figure9")
    result = run("reproduce", *only, "--out", "figures", "--page", "p.html", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "2.300" in result.stdout
    assert "+9.91 ms" in result.stdout
    assert "reproduced to every digit" in result.stdout
    files = {path.name for path in (tmp_path / "figures").iterdir()}
    assert files == {"table2.png", "gap.png", "figure9.png"}
    assert "<svg" in (tmp_path / "p.html").read_text(encoding="utf-8")


def test_the_command_as_json(tmp_path):
    told = run_json("reproduce", "--only", "figure9", "--pictures", "svg", cwd=tmp_path)
    assert [one["verdict"] for one in told["parts"]["figure9"]["comparisons"]] == ["confirmed"] * 2
    assert (tmp_path / told["figures"]["figure9"]).suffix == ".svg"
    assert (tmp_path / told["page"]).exists()


def test_the_command_refuses_an_unknown_part(tmp_path):
    said = one_clear_line(run("reproduce", "--only", "figure5", cwd=tmp_path))
    assert "figure5 cannot be reproduced" in said
    assert "\n" not in said
