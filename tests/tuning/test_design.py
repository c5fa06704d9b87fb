"""Design: the best gains against closed forms and brute force; margins; all delays."""

import functools
import itertools
import math
import sys

import deadtime as dtm
import numpy as np
import pytest
from deadtime.tuning import critical_gain
from deadtime.tuning._problem import pose

LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
SAMPLED = dtm.ControlLoop(
    dtm.Integrator(0.85, 0.1), dtm.P(1.0), delay=0.25, sample_time=0.065, limit=1.0
)
FILTER = dtm.DerivativeFilter(38.0)
SMOOTH = dtm.PV(1.0, 0.1, FILTER)


# The most stable gains, by other means


@pytest.mark.parametrize(
    ("controller", "Kv", "near", "abscissa", "critical"),
    [(dtm.PV, 0.2415, 5e-4, -3.6841, 0.9685), (SMOOTH, 0.190, 1e-3, -2.645, 0.8904)],
)
def test_the_papers_loop_with_its_proportional_gain(controller, Kv, near, abscissa, critical):
    # The paper takes Kv = 0.3 from a grid of 0.1, with -3.317.
    best = dtm.design(LOOP, controller=controller, fixed={"Kp": 2.0}, objective="abscissa")
    assert best.gains["Kp"] == 2.0
    assert best.fixed == ("Kp",)
    assert best.gains["Kv"] == pytest.approx(Kv, abs=near)
    assert best.abscissa == pytest.approx(abscissa, abs=5e-4)
    # It is a kink: nothing within a millionth is better.
    for off in (-1e-6, 1e-6):
        assert best.loop.replace(Kv=best.gains["Kv"] + off).spectral_abscissa() > best.abscissa
    assert best.loop.stable_range("Kv")[1] == pytest.approx(critical, abs=5e-5)
    (chart,) = best.charts
    assert chart.names == ("Kv", "delay")
    assert 0.36 in chart.axes["delay"]


@pytest.mark.parametrize("delay", [0.01, 0.36, 5.0])
def test_proportional_control_is_best_where_two_roots_meet(delay):
    # s + K e^(-sT) has a double root -1/T at K = 1/(e T)
    best = dtm.design(LOOP, controller=dtm.P, delay=delay, objective="abscissa")
    assert best.gains["Kp"] == pytest.approx(1.0 / (math.e * delay), rel=1e-6)
    assert best.abscissa == pytest.approx(-1.0 / delay, rel=1e-3)


def test_both_gains_are_best_where_three_roots_meet():
    # s + (Kp + Kv s) e^(-sT) has a triple root -2/T at Kv = e^-2, Kp = 4 e^-2/T
    best = dtm.design(LOOP, objective="abscissa")
    assert best.gains["Kv"] == pytest.approx(math.exp(-2.0), rel=1e-3)
    assert best.gains["Kp"] == pytest.approx(4.0 * math.exp(-2.0) / 0.36, rel=1e-3)
    assert best.abscissa == pytest.approx(-2.0 / 0.36, rel=2e-3)
    assert best.abscissa == pytest.approx(best.loop.spectral_abscissa(), rel=1e-9)
    assert best.abscissa <= best.charts[0].best()[1]


def test_a_sampled_loop_by_brute_force():
    best = dtm.design(SAMPLED, controller=SMOOTH, fixed={"Kp": 2.0}, objective="abscissa")
    found = [SAMPLED.replace(controller=dtm.PV(2.0, Kv, FILTER)) for Kv in np.linspace(0, 0.6, 601)]
    least = [max(np.log(np.abs(np.linalg.eigvals(one.transition_matrix())))) for one in found]
    assert best.abscissa <= min(least) / 0.065 + 1e-9
    assert best.gains["Kv"] == pytest.approx(np.linspace(0, 0.6, 601)[np.argmin(least)], abs=2e-3)


@pytest.mark.parametrize("controller", [dtm.PI, dtm.PID(1.0, 0.1, 0.1, FILTER), SMOOTH])
def test_no_neighbour_of_the_best_gains_is_better(controller):
    best = dtm.design(SAMPLED, controller=controller, objective="abscissa")
    rng = np.random.default_rng(1)
    for size in (1e-3, 1e-2, 0.1):
        for _ in range(40):
            off = {name: g * (1.0 + size * rng.normal()) for name, g in best.gains.items()}
            assert best.loop.replace(**off).spectral_abscissa() > best.abscissa * (1.0 + 2e-3)


def test_a_filter_is_kept_or_given():
    kept = dtm.design(SAMPLED, controller=SMOOTH, shape=(15, 15), objective="abscissa")
    assert kept.loop.controller.filter == FILTER
    given = dtm.design(SAMPLED, filter=FILTER, shape=(15, 15), objective="abscissa")
    assert given.loop.controller == kept.loop.controller


# Margins


@functools.cache
def without_requirements(loop):
    return dtm.design(loop, controller=SMOOTH, objective="abscissa")


@pytest.mark.parametrize("loop", [LOOP, SAMPLED.replace(delay=0.36)])
@pytest.mark.parametrize(
    "required", [{"gain_margin": 5.0}, {"phase_margin": 72.0}, {"delay_margin": 1.4}]
)
def test_a_margin_that_is_asked_for_is_there_exactly(loop, required):
    best = dtm.design(loop, controller=SMOOTH, **required, objective="abscissa")
    ((name, least),) = required.items()
    had = getattr(best.loop.margin(), name)
    assert least <= had < least * 1.001  # active, and no more than that
    assert getattr(best.margins, name) == pytest.approx(had, rel=1e-9)
    (trade,) = best.traded
    assert trade.active
    assert trade.without < best.value - 0.05
    free = without_requirements(loop)
    assert trade.without == pytest.approx(free.value, rel=2e-3)
    if not loop.is_sampled and name != "phase_margin":
        assert best.proved == ("stable", name)


@pytest.mark.survey
def test_the_best_gains_within_margins_by_brute_force():
    best = dtm.design(
        SAMPLED, controller=SMOOTH, gain_margin=5.0, phase_margin=72.0, objective="abscissa"
    )
    Kp, Kv = (
        axis.ravel()
        for axis in np.meshgrid(np.linspace(0.8, 1.4, 13), np.linspace(-0.05, 0.25, 13))
    )
    least = 0.0
    for gains in zip(Kp, Kv, strict=True):
        one = SAMPLED.replace(controller=dtm.PV(*gains, FILTER))
        if one.spectral_abscissa() < least:
            found = one.margin()
            if found.gain_margin >= 5.0 and found.phase_margin >= 72.0:
                least = one.spectral_abscissa()
    assert least < 0.0
    assert best.abscissa <= least + 1e-6


@functools.cache
def designed_in(unit):
    """The same loop with its times in other units."""
    loop = dtm.ControlLoop(dtm.Integrator(0.85, 0.1 * unit), dtm.P(1.0), sample_time=0.065 * unit)
    smooth = dtm.PV(1.0, 0.1, dtm.DerivativeFilter(38.0 / unit))
    late = (0.2 * unit, 0.3 * unit)
    return dtm.design(
        loop, controller=smooth, delay=late, gain_margin=4.0, shape=(31, 31), objective="abscissa"
    )


@pytest.mark.survey
@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_a_design_does_not_depend_on_the_unit_of_time(scale):
    one, other = designed_in(1.0), designed_in(scale)
    assert other.gains["Kp"] * scale == pytest.approx(one.gains["Kp"], rel=1e-3)
    assert other.abscissa * scale == pytest.approx(one.abscissa, rel=1e-3)
    assert other.margins.delay_margin / scale == pytest.approx(one.margins.delay_margin, rel=1e-3)


def test_margins_that_are_met_anyway_cost_nothing():
    best = dtm.design(
        LOOP, controller=SMOOTH, gain_margin=2.0, delay_margin=0.1, objective="abscissa"
    )
    free = without_requirements(LOOP)
    assert best.value == pytest.approx(free.value, rel=1e-3)
    assert not any(trade.active for trade in best.traded)
    assert "met anyway" in best.summary()


def test_margins_that_nothing_meets_are_refused_with_the_best_there_is():
    with pytest.raises(ValueError, match=r"alone can reach at most gain .*phase .*nearest"):
        dtm.design(
            SAMPLED,
            ranges={"Kp": (1.0, 4.0), "Kv": (0.0, 0.5)},
            gain_margin=4.0,
            phase_margin=100.0,
            objective="abscissa",
        )


@pytest.mark.parametrize("loop", [LOOP, LOOP.replace(sample_time=0.065), SAMPLED])
def test_margins_of_the_search_are_those_of_the_loop(loop):
    problem = posed(loop, SMOOTH)
    points = np.array([[1.0, 0.1], [2.0, 0.2], [2.5, 0.4], [0.3, -0.02]])
    of = problem.candidates(problem.corners)
    for gains, (found,) in zip(points, of.all_margins(points, None), strict=True):
        loop = problem.at(gains)
        exact = loop.margin()
        assert found[:2] == pytest.approx([exact.gain_margin, exact.phase_margin], rel=1e-9)
        # A turn is not quite a delay where the hold's fraction of a sample matters.
        assert found[2] == pytest.approx(exact.delay_margin, rel=5e-2 if loop.is_sampled else 1e-9)
        had = of.margins(gains.tolist(), True)[0, :3]
        assert had == pytest.approx([*found[:2], exact.delay_margin], rel=1e-9)
        assert of.dominant(gains.tolist())[0, 1] == pytest.approx(loop.spectral_abscissa())


@pytest.mark.parametrize("share", [0.2, 1.0, 1.8])
def test_a_gain_margin_at_half_the_sampling_rate_is_found(share):
    # Without a delay the pole 1 - Kp Ts leaves the circle at -1.
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.0, sample_time=0.065)
    problem = posed(loop, dtm.P(1.0))
    gains = np.array([[share / 0.065]])
    found = problem.candidates(problem.corners).all_margins(gains, None)[0, 0]
    assert found[0] == pytest.approx(2.0 / share, rel=1e-9)


PROCESS = dtm.ControlLoop(dtm.FirstOrder(2.0, 10.0), dtm.PI(1.0, 0.1), delay=2.0)


@pytest.mark.parametrize(
    ("loop", "options"),
    [
        (LOOP, {"objective": "abscissa", "gain_margin": 2.0, "phase_margin": 45.0}),
        (SAMPLED, {"objective": "abscissa", "gain_margin": 2.0, "phase_margin": 45.0}),
        (SAMPLED, {"objective": "settling_time"}),
        (SAMPLED, {"objective": "overshoot"}),
        (SAMPLED, {"objective": "settling_time", "delay": (0.2, 0.3), "shape": (15, 15)}),
        (PROCESS, {"controller": dtm.PI, "objective": "settling_time"}),
        (PROCESS, {"controller": dtm.PI, "settling_time": 40.0}),
        (PROCESS, {"controller": dtm.PI, "delay": (1.6, 2.4), "gain_margin": 3.0}),
    ],
)
def test_a_design_makes_few_calls(loop, options):
    """It made 130 000: margins in numpy, and a loop anew for each of a thousand gains."""
    calls = 0

    def count(frame, event, argument):
        nonlocal calls
        calls += event == "call"

    dtm.design(loop, **options)  # what is imported first is not counted
    sys.setprofile(count)
    try:
        dtm.design(loop, **options)
    finally:
        sys.setprofile(None)
    assert 0 < calls < 4000


def posed(loop, controller):
    return pose(loop, controller, None, None, fixed=None, ranges=None, amplitude=1.0, threads=None)


# What is not known


def test_gains_for_an_interval_hold_on_all_of_it():
    best = dtm.design(SAMPLED, delay=(0.2, 0.3), controller=SMOOTH, objective="abscissa")
    assert best.delays == (0.2, 0.25, 0.3)
    worst = max(
        best.loop.replace(delay=delay).spectral_abscissa() for delay in np.linspace(0.2, 0.3, 301)
    )
    assert worst <= best.abscissa + 1e-4 * abs(best.abscissa)
    assert best.worst["delay"] in (0.2, 0.3) or 0.2 < best.worst["delay"] < 0.3
    # Each delay for itself could do better, none worse.
    for delay in (0.2, 0.25, 0.3):
        alone = dtm.design(SAMPLED, delay=delay, controller=SMOOTH, objective="abscissa")
        assert alone.abscissa <= best.abscissa + 1e-6
    (trade,) = best.traded
    assert trade.requirement == "interval"
    assert trade.without == pytest.approx(without_requirements(SAMPLED).value, rel=2e-3)


@pytest.mark.survey
def test_margins_hold_for_every_delay_and_gain():
    best = dtm.design(
        SAMPLED,
        delay=(0.2, 0.3),
        gain=(0.7, 1.0),
        controller=SMOOTH,
        gain_margin=4.0,
        objective="abscissa",
    )
    assert best.gain == (0.7, 1.0)
    for delay in np.linspace(0.2, 0.3, 7):
        for gain in (0.7, 0.83, 1.0):
            one = best.loop.replace(delay=delay, gain=gain)
            assert one.spectral_abscissa() <= best.abscissa + 1e-6
            assert one.margin().gain_margin >= 4.0 - 1e-9
    assert best.checked >= 81


def test_a_worst_delay_inside_the_interval_is_found():
    # Around the best gain for one delay the abscissa has a kink in the delay, too, and with a
    # resonant plant the worst delay is none of the ends: the middle of a wide interval misleads.
    plant = dtm.RationalPlant([4.0], [1.0, 0.4, 4.0])
    loop = dtm.ControlLoop(plant, dtm.P(1.0), delay=1.0)
    best = dtm.design(
        loop,
        controller=dtm.PI,
        delay=(0.1, 1.3),
        ranges={"Kp": (-0.3, 0.3), "Ki": (0.01, 0.4)},
        objective="abscissa",
    )
    fine = [best.loop.replace(delay=d).spectral_abscissa() for d in np.linspace(0.1, 1.3, 601)]
    assert max(fine) <= best.abscissa + 1e-4
    assert best.proved == ("stable",)


def test_proofs_for_an_interval_of_the_delay_and_the_gain():
    best = dtm.design(
        LOOP,
        controller=SMOOTH,
        delay=(0.3, 0.4),
        gain=(0.9, 1.1),
        gain_margin=2.0,
        delay_margin=0.5,
        shape=(11, 11),
        objective="abscissa",
    )
    assert best.proved == ("stable", "gain_margin", "delay_margin")
    boxes = dtm.proved_boxes(best.loop, {"delay": (0.3, 0.9), "gain": (0.9, 1.1)}, tol=0.0)
    assert (boxes.unstable == 0).all()


# Other objectives


def test_the_damping_is_that_of_the_dominant_poles():
    best = dtm.design(SAMPLED, controller=SMOOTH, objective="damping", delay=(0.2, 0.3))
    ratios = []
    for delay in np.linspace(0.2, 0.3, 11):
        z = np.linalg.eigvals(best.loop.replace(delay=delay).transition_matrix())
        s = np.log(z[np.abs(z) > 1e-9].astype(complex)) / 0.065
        near = s[s.real >= 3.0 * s.real.max()]
        ratios.append((-near.real / np.abs(near)).min())
    assert min(ratios) >= best.value - 1e-3
    assert best.damping == best.value
    calm = dtm.design(SAMPLED, controller=SMOOTH, delay=(0.2, 0.3), objective="abscissa")
    assert best.value > calm.damping + 0.1


def test_equal_damping_is_decided_by_the_abscissa():
    best = dtm.design(LOOP, controller=dtm.P, objective="damping")
    assert best.value == pytest.approx(1.0, abs=1e-6)
    assert best.gains["Kp"] == pytest.approx(1.0 / (math.e * 0.36), rel=1e-3)


def test_chains_of_a_neutral_loop_have_no_damping():
    for controller, damping in ((dtm.PV(2.0, 0.3), 0.0), (dtm.P(1.0), 1.0)):
        problem = posed(LOOP, controller)
        of = problem.candidates(problem.corners)
        assert of.dominant(list(controller.gains.values()))[0, 0] == damping


def swept_settling(loop, gains):
    """Settling times, the longest for gains half a percent beside these as well."""
    every = [gains]
    for signs in itertools.product((0.995, 1.005), repeat=len(gains)):
        named = zip(gains.items(), signs, strict=True)
        every.append({name: values * sign for (name, values), sign in named})
    return np.max([dtm.sweep(loop, one, 20.0)["settling_time"] for one in every], axis=0)


@pytest.mark.survey
def test_the_settling_time_is_that_of_the_simulated_loop():
    best = dtm.design(SAMPLED, objective="settling_time")
    settled = best.loop.step_response().info()["settling_time"]
    assert settled <= best.value + 1e-3 <= 1.05 * settled
    # brute force over gains, the step simulated as far as it needs
    Kp, Kv = np.ix_(np.linspace(0.5, 5.0, 91), np.linspace(-0.1, 1.0, 89))
    swept = swept_settling(SAMPLED.replace(controller=dtm.PV(1.0, 0.1)), {"Kp": Kp, "Kv": Kv})
    assert best.value <= np.nanmin(swept) * 1.05
    assert best.step_info["settling_time"] == pytest.approx(settled, abs=1e-3)
    assert best.step_info["peak_command"] == 1.0
    assert 0.5 < best.step_info["time_at_limit"] < 1.5


@pytest.mark.survey
def test_the_fastest_settling_along_one_gain():
    best = dtm.design(SAMPLED, controller=SMOOTH, fixed={"Kp": 2.0}, objective="settling_time")
    Kv = np.linspace(-0.1, 0.8, 2001)
    swept = swept_settling(SAMPLED.replace(controller=dtm.PV(2.0, 0.1, FILTER)), {"Kv": Kv})
    assert best.value <= np.nanmin(swept) * 1.03


def test_a_step_that_the_limit_forbids_is_refused():
    loop = dtm.ControlLoop(dtm.FirstOrder(1.0, 1.0), dtm.P(1.0), delay=0.3, limit=0.5)
    with pytest.raises(ValueError, match="does not settle"):
        dtm.design(
            loop,
            controller=dtm.PI,
            objective="settling_time",
            ranges={"Kp": (0.5, 2.0), "Ki": (0.5, 2.0)},
            shape=(9, 9),
        )


@pytest.mark.survey
def test_the_step_matters_where_there_is_a_limit():
    small = dtm.design(SAMPLED, objective="settling_time", amplitude=0.1, controller=SMOOTH)
    large = dtm.design(SAMPLED, objective="settling_time", amplitude=2.0, controller=SMOOTH)
    assert large.value > 1.5 * small.value
    assert large.amplitude == 2.0
    assert large.step_info["steady_state"] == pytest.approx(2.0)


@pytest.mark.survey
def test_the_fastest_step_without_overshoot_over_an_interval():
    best = dtm.design(SAMPLED, objective="overshoot", delay=(0.22, 0.28), controller=SMOOTH)
    over = []
    for delay in np.linspace(0.22, 0.28, 13):
        info = best.loop.replace(delay=delay).step_response().info()
        over.append(info["overshoot"])
        assert info["settling_time"] < 2.6
    assert max(over) <= best.value + 0.02
    assert best.value < 0.3


@pytest.mark.survey
def test_metrics_are_those_of_the_worst_scenario():
    best = dtm.design(
        SAMPLED, objective="settling_time", delay=(0.2, 0.3), controller=SMOOTH, gain_margin=3.0
    )
    times = [
        best.loop.replace(delay=delay).step_response().info()["settling_time"]
        for delay in np.linspace(0.2, 0.3, 9)
    ]
    assert max(times) <= best.value + 1e-3
    assert best.margins.gain_margin >= 3.0


# Refusals, and the result


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"controller": "PV"}, TypeError, "not a controller"),
        ({"delay": (0.4, 0.3)}, ValueError, "low end"),
        ({"delay": -0.1}, ValueError, "delay"),
        ({"gain": (-1.0, 1.0)}, ValueError, "both positive"),
        ({"objective": "beauty"}, ValueError, "beauty"),
        ({"ranges": {"Kp": (0, 1)}}, ValueError, "gains are"),
        ({"ranges": {"Kp": (1, 1), "Kv": (0, 1)}}, ValueError, "low end"),
        ({"ranges": {"Kp": (20, 30), "Kv": (0, 0.5)}}, ValueError, "none is stable"),
        ({"shape": (5,)}, ValueError, "2 numbers"),
        ({"fixed": {"Ki": 1.0}}, ValueError, "no gain 'Ki'"),
        ({"fixed": {"Kp": 1.0, "Kv": 0.1}}, ValueError, "every gain"),
        ({"gain_margin": 0.5}, ValueError, "above 1"),
        ({"phase_margin": 200.0}, ValueError, "below 180"),
        ({"delay_margin": -1.0}, ValueError, "delay_margin"),
        ({"amplitude": 0.0}, ValueError, "not a step"),
        ({"filter": "best"}, ValueError, "auto"),
        ({"filter": FILTER, "controller": dtm.PI}, ValueError, "no derivative"),
    ],
)
def test_what_cannot_be_designed_is_refused(change, error, words):
    with pytest.raises(error, match=words):
        dtm.design(LOOP, **({"shape": (5, 5), "objective": "abscissa"} | change))


def test_an_unknown_delay_is_refused():
    with pytest.raises(ValueError, match="not known"):
        dtm.design(LOOP.replace(delay=None), objective="abscissa")


def test_a_design_without_delay_could_not_be_drawn():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.0, sample_time=0.065)
    best = dtm.design(loop, controller=dtm.P, objective="abscissa")
    # The chart over gain and delay was one line high. Dead beat: 1 - Kp Ts = 0.
    best.plot().canvas.draw()
    assert best.gains["Kp"] * 0.065 == pytest.approx(1.0, abs=0.01)


def test_a_design_has_a_summary_and_a_plot():
    pyplot = pytest.importorskip("matplotlib.pyplot")
    best = dtm.design(
        SAMPLED,
        controller=SMOOTH,
        fixed={"Kp": 1.5},
        delay=(0.2, 0.3),
        gain_margin=3.0,
        objective="abscissa",
    )
    told = best.summary()
    for words in ("Kp = 1.5 (given)", "least margins: gain", "scenarios checked", "at the limit"):
        assert words in told
    figure = best.plot()
    titles = [ax.get_title() for ax in figure.axes]
    assert any("gain margin" in title for title in titles)
    pyplot.close("all")


@pytest.mark.parametrize("delay", [1e-5, 0.01, 0.36, 20.0])
def test_the_critical_gain_is_found_over_many_decades(delay):
    # s + Kp e^(-sT) loses stability at Kp T = pi/2
    assert critical_gain(LOOP.replace(delay=delay)) == pytest.approx(np.pi / 2 / delay, rel=1e-9)


def test_a_deadbeat_loop_has_a_margin_that_it_just_reaches():
    # Without a delay the best gain is 1/(gain sample_time), and its gain margin is 2.
    loop = dtm.ControlLoop(dtm.Integrator(0.885), dtm.P(1.0), delay=0.0, sample_time=0.065)
    found = dtm.design(loop, controller=dtm.PV, gain_margin=2.0, objective="abscissa")
    assert found.loop.margin().gain_margin >= 2.0 * (1.0 - 1e-6)
    assert found.loop.parameters["Kp"] == pytest.approx(1.0 / (0.885 * 0.065), rel=1e-3)
