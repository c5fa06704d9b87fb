"""Maps of sampled loops: against eigenvalues of transition matrices, and cell by cell."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.stability import MapStatus

SMOOTH = dtm.DerivativeFilter(30.0)

#: Loops of which two numbers vary, with the ranges of these.
FAMILIES = [
    (
        dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.3), delay=0.36, sample_time=0.065),
        {"Kp": (-0.5, 6.0), "Kv": (-0.9, 1.1)},
    ),
    (
        dtm.ControlLoop(
            dtm.Integrator(0.85, 0.17), dtm.PV(2.0, 0.3, SMOOTH), delay=0.1, sample_time=0.02
        ),
        {"Kp": (0.0, 6.0), "lag": (0.0, 0.4)},
    ),
    (
        dtm.ControlLoop(
            dtm.kit_plant(), dtm.PID(1.0, 0.2, 0.1, SMOOTH), delay=0.05, sample_time=0.01
        ),
        {"Ki": (-1.0, 6.0), "Kd": (-0.5, 1.0)},
    ),
    (
        dtm.ControlLoop(
            dtm.FirstOrder(2.0, -1.0), dtm.PI(-1.2, -0.1), delay=0.13, sample_time=0.065
        ),
        {"gain": (0.1, 6.0), "delay": (0.0, 0.4)},
    ),
    (
        dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.3, sample_time=0.065),
        {"sample_time": (0.01, 0.5), "delay": (0.0, 0.9)},
    ),
]


def poles_of(loop):
    z = np.linalg.eigvals(loop.transition_matrix())
    with np.errstate(divide="ignore"):
        return np.log(z[z != 0.0].astype(complex)) / loop.sample_time


def number_of(poles, decay, damping):
    """Poles that violate the demand, and whether one is too close to its edge to tell."""
    bad, close = poles.real > -decay, np.abs(poles.real + decay) < 1e-6
    if damping is not None:
        ratio, horizon = damping
        weak = -poles.real / np.maximum(np.abs(poles), 1e-300) - ratio
        bad |= (weak < 0.0) & (poles.real > -horizon)
        close |= (np.abs(weak) < 1e-6) | (np.abs(poles.real + horizon) < 1e-6)
    return int(bad.sum()), bool(close.any())


@pytest.mark.parametrize("demand", [(0.0, None), (0.4, None), (0.1, (0.4, 3.0))])
@pytest.mark.parametrize(("loop", "ranges"), FAMILIES)
def test_cells_are_counts_of_eigenvalues(loop, ranges, demand):
    decay, damping = demand
    chart = dtm.stability_map(loop, ranges, (17, 13), decay=decay, damping=damping)
    assert (chart.status == MapStatus.OK).mean() > 0.93
    compared = 0
    names = list(ranges)
    for (i, j), known in np.ndenumerate(chart.status):
        cell = loop.replace(
            **{names[0]: chart.axes[names[0]][i], names[1]: chart.axes[names[1]][j]}
        )
        poles = poles_of(cell)
        number, close = number_of(poles, decay, damping)
        if close or known != MapStatus.OK:
            continue
        assert chart.unstable[i, j] == number
        if poles.size == 0:
            # All eigenvalues are zero: the motion is over after some samples.
            assert chart.abscissa[i, j] * cell.sample_time < -5.0
            continue
        assert chart.abscissa[i, j] == pytest.approx(poles.real.max(), rel=1e-6, abs=1e-6)
        compared += 1
    assert compared > 150


@pytest.mark.parametrize(("loop", "ranges"), FAMILIES)
def test_rows_prove_what_single_cells_do(loop, ranges):
    curves = dtm.stability_map(loop, ranges, (37, 29), abscissa=False)
    cells = dtm.stability_map(loop, ranges, (37, 29), abscissa=False, proof="cells")
    np.testing.assert_array_equal(curves.unstable, cells.unstable)
    np.testing.assert_array_equal(curves.status, cells.status)
    one = dtm.stability_map(loop, ranges, (37, 29), abscissa=False, threads=1)
    np.testing.assert_array_equal(curves.unstable, one.unstable)


@pytest.mark.parametrize(("loop", "ranges"), FAMILIES[:4])
def test_a_pole_is_on_the_circle_along_the_boundaries(loop, ranges):
    chart = dtm.stability_map(loop, ranges, (41, 41), abscissa=False)
    assert chart.boundaries
    for curve in chart.boundaries:
        for place in range(0, len(curve), 7):
            cell = loop.replace(**{name: v[place] for name, v in curve.values.items()})
            target = np.exp(1j * curve.omega[place] * cell.sample_time)
            z = np.linalg.eigvals(cell.transition_matrix())
            assert np.abs(z - target).min() < 1e-6


def test_boundaries_need_a_gain():
    loop, ranges = FAMILIES[4]
    with pytest.raises(ValueError, match="is a gain"):
        _ = dtm.stability_map(loop, ranges, (5, 5), abscissa=False).boundaries


def test_a_kilohertz_loop_tends_to_the_continuous_one():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=1e-3)
    gains = {"Kp": (0.1, 9.0), "gain": (0.5, 1.5)}
    fast = dtm.stability_map(loop, gains, (60, 40), abscissa=False)
    # The hold adds half a sample to the delay, but for terms of second order.
    slow = dtm.stability_map(
        loop.continuous().replace(delay=0.3605), gains, (60, 40), abscissa=False
    )
    assert (fast.unstable == slow.unstable).all()


def test_more_states_than_a_map_takes_are_refused():
    plant = dtm.RationalPlant([1.0], np.poly(-np.linspace(1.0, 5.0, 25)))
    loop = dtm.ControlLoop(plant, dtm.P(1.0), delay=0.1, sample_time=0.1)
    with pytest.raises(ValueError, match="at most 24"):
        dtm.stability_map(loop, {"Kp": (0.0, 1.0), "delay": (0.0, 1.0)}, (3, 3))


def test_a_plant_of_high_order_at_a_kilohertz():
    """Cells too close to a crossing for their rounding made margins say that a loop is unstable."""
    den = np.poly(-np.geomspace(0.3, 60.0, 7))
    plant = dtm.RationalPlant([den[-1]], den)
    loop = dtm.ControlLoop(plant, dtm.PI(1.0, 0.3), delay=0.06, sample_time=1e-3)
    chart = dtm.stability_map(loop, {"Kp": (0.2, 6.0), "Ki": (0.1, 2.0)}, (6, 4))
    assert (chart.status == MapStatus.OK).any()
    for (i, j), known in np.ndenumerate(chart.status):
        cell = loop.replace(Kp=chart.axes["Kp"][i], Ki=chart.axes["Ki"][j])
        poles = poles_of(cell)
        if known == MapStatus.OK:
            assert chart.unstable[i, j] == number_of(poles, 0.0, None)[0]
        assert chart.abscissa[i, j] == pytest.approx(poles.real.max(), rel=1e-6, abs=1e-6)
    margins = loop.margin()
    assert margins.stable
    assert loop.replace(delay=0.06 + margins.delay_margin * (1.0 - 1e-3)).is_stable()
    assert not loop.replace(delay=0.06 + margins.delay_margin * (1.0 + 1e-3)).is_stable()
