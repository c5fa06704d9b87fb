"""Masked entries are not used as numbers: they are missing rows, or they are refused."""

import deadtime as dtm
import numpy as np
import pytest

LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.8), delay=0.36)
SAMPLED = LOOP.replace(sample_time=0.065)
h = dtm.s + dtm.delay(1.0)
G = dtm.feedback(2.0 / dtm.s * dtm.delay(0.36))
SYSTEM = dtm.DelaySystem(A={0.36: -2.0}, B={0.36: 2.0})
Kp, T = dtm.parameters("Kp T")
FAMILY = dtm.s + Kp * dtm.delay(T)
(CHAIN,) = (dtm.s + (2.0 + 0.3 * dtm.s) * dtm.delay(0.36)).chains()
TIME = np.linspace(0.0, 1.0, 9)
FLAT = {"Kp": (0.1, 3.0), "T": (0.1, 0.5)}


def solved(**changes):
    return dtm.solve_dde(
        lambda t, y, z: -z[0], (0.0, 1.0), **({"history": 1.0, "delays": 1.0} | changes)
    )


#: Public functions, each with one masked array among its arguments.
TAKERS = {
    "QuasiPolynomial coefficients": lambda x: dtm.QuasiPolynomial([x], [0.0]),
    "QuasiPolynomial delays": lambda x: dtm.QuasiPolynomial([[1.0]] * x.size, x),
    "QuasiPolynomial()": lambda x: h(x),
    "QuasiPolynomial roots": lambda x: h.roots(re=x[:2], im=(0, 3)),
    "TransferFunction": lambda x: dtm.TransferFunction(x, [1.0, 1.0]),
    "TransferFunction()": lambda x: G(x),
    "TransferFunction frequency_response": lambda x: G.frequency_response(x),
    "TransferFunction phase": lambda x: G.phase(x),
    "TransferFunction step_response": lambda x: G.step_response(x),
    "TransferFunction bode": lambda x: G.bode(x),
    "TransferFunction nyquist": lambda x: G.nyquist(x),
    "DelaySystem A": lambda x: dtm.DelaySystem(A={0.3: np.ma.outer(x, x)}),
    "DelaySystem matrix": lambda x: SYSTEM.characteristic_matrix(x),
    "DelaySystem frequency_response": lambda x: SYSTEM.frequency_response(x),
    "DelaySystem step_response": lambda x: SYSTEM.step_response(x),
    "simulate time": lambda x: SYSTEM.simulate(x, 1.0),
    "simulate inputs": lambda x: SYSTEM.simulate(TIME, x, input_time=TIME),
    "ControlLoop simulate": lambda x: LOOP.simulate(x),
    "ControlLoop reference": lambda x: LOOP.simulate(TIME, x, reference_time=TIME),
    "ControlLoop reference_time": lambda x: LOOP.simulate(TIME, TIME, reference_time=x),
    "ControlLoop command_history": lambda x: SAMPLED.simulate(TIME, command_history=x),
    "ControlLoop frequency_response": lambda x: LOOP.frequency_response(x),
    "ControlLoop bode": lambda x: LOOP.bode(x),
    "FactoredPlant": lambda x: dtm.FactoredPlant(x),
    "RationalPlant": lambda x: dtm.RationalPlant(x, [1.0, *np.ones(x.size)]),
    "stability_map": lambda x: dtm.stability_map(FAMILY, FLAT | {"Kp": x}, shape=(9, 3)),
    "stability_map of a loop": lambda x: dtm.stability_map(SAMPLED, {"Kp": x, "gain": (0.5, 1)}),
    "robust_map": lambda x: dtm.robust_map(LOOP, {"Kp": x, "gain": (1, 2)}, {"delay": (0.3, 0.4)}),
    "sweep": lambda x: dtm.sweep(SAMPLED, {"Kp": x}),
    "sweep time": lambda x: dtm.sweep(SAMPLED, {"Kp": [1.0]}, x, responses=True),
    "solve_dde history": lambda x: solved(history=x),
    "solve_dde y0": lambda x: solved(history=lambda t: np.ones(x.size), y0=x),
    "solve_dde delays": lambda x: solved(delays=x),
    "solve_dde t_eval": lambda x: solved(t_eval=x),
    "solve_dde atol": lambda x: solved(history=np.ones(x.size), atol=x),
    "DelaySolution()": lambda x: solved(dense_output=True).sol(x),
    "Chain starts": lambda x: CHAIN.starts(x.astype(int)),
    "Chain real_part": lambda x: CHAIN.real_part(x),
    "design_filter omegas": lambda x: dtm.design_filter(SAMPLED, omegas=x),
    "dde_roots": lambda x: dtm.dde_roots(0.0, -x, 1.0),
    "lambertw": lambda x: dtm.lambertw(x),
    "lambertw branches": lambda x: dtm.lambertw(1.0, x.astype(int)),
    "lambertw0": lambda x: dtm.lambertw0(x),
    "lambertw_offset": lambda x: dtm.special.lambertw_offset(x)[0],
    "wrightomega": lambda x: dtm.wrightomega(x),
    "number": lambda x: dtm.P(x[1]),
    "list of arrays": lambda x: dtm.QuasiPolynomial([x, x], [0.0, 1.0]),
}


MASKED = np.ma.array([1.0, 1e6], mask=[False, True])

#: Functions of `solve_dde` that return a masked value.
RETURNS = {
    "fun": lambda value: solved2(lambda t, y, z: value),
    "fun of nodes": lambda value: solved2(
        lambda t, y, z: np.ma.stack([value] * t.size, axis=1), vectorized=True
    ),
    "rows of nodes": lambda value: solved2(
        lambda t, y, z: [value[[1]].repeat(t.size)] * 2, vectorized=True
    ),
    "list": lambda value: solved2(lambda t, y, z: list(value)),
    "history": lambda value: solved2(lambda t, y, z: -y, history=lambda t: value),
    "event": lambda value: solved2(lambda t, y, z: -y, events=lambda t, y: value[1]),
    "change": lambda value: solved2(lambda t, y, z: -y, jumps=[(0.5, lambda t, y: value)]),
}


def solved2(fun, history=(1.0, 1.0), **options):
    return dtm.solve_dde(fun, (0.0, 1.0), history, 1.0, **options)


@pytest.mark.parametrize("what", RETURNS)
def test_a_masked_value_that_a_function_returns_is_refused(what):
    # What was under the mask was the slope.
    with pytest.raises(ValueError, match="masked"):
        RETURNS[what](MASKED)


def test_a_mask_without_masked_entries_is_no_obstacle():
    plain = solved2(lambda t, y, z: -y)
    masked = solved2(lambda t, y, z: np.ma.array(-y, mask=False))
    assert np.array_equal(plain.y, masked.y)


#: Functions whose result has the mask of the argument.
UFUNCS = (
    "dde_roots",
    "lambertw",
    "lambertw branches",
    "lambertw0",
    "lambertw_offset",
    "wrightomega",
)


@pytest.mark.parametrize("taker", TAKERS)
def test_no_function_takes_what_is_under_a_mask(taker):
    # NumPy drops the mask in a conversion, and the masked 1e6 was used as a number.
    values = np.array([0.1, 1e6, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])
    masked = np.ma.array(values, mask=values > 1e5)
    if taker in UFUNCS:
        found = TAKERS[taker](masked)
        assert np.ma.getmaskarray(found).tolist() == masked.mask.tolist()
        return
    with pytest.raises(ValueError, match="masked"):
        TAKERS[taker](masked)


@pytest.mark.parametrize("taker", ["ControlLoop simulate", "TransferFunction()", "sweep"])
def test_a_mask_without_masked_entries_has_no_effect(taker):
    TAKERS[taker](np.ma.array(np.linspace(0.1, 0.9, 9), mask=False))


class Missing:
    """The missing value of pandas in nullable columns, which is not a number."""

    def __float__(self):
        raise TypeError("float() argument must be a string or a real number, not 'NAType'")


@pytest.mark.parametrize(
    "taker", ["ControlLoop simulate", "sweep", "stability_map", "QuasiPolynomial()"]
)
@pytest.mark.parametrize("missing", [None, Missing()])
def test_missing_values_of_tables_are_refused(taker, missing):
    column = np.array([0.1, missing, *np.linspace(0.3, 0.9, 7)], dtype=object)
    with pytest.raises(TypeError, match=r"object|number"):
        TAKERS[taker](column)


# Recordings: a masked row is a missing row.

ROWS = np.arange(40) * 0.1
STEP = (ROWS > 0.95).astype(float)
OUTPUT = np.sin(ROWS)


def masked(values, *rows):
    mask = np.zeros(values.size, dtype=bool)
    mask[list(rows)] = True
    return np.ma.array(np.where(mask, 1e6, values), mask=mask)


@pytest.mark.parametrize("rows", [(3,), (0, 1), (20, 21, 22), (39,)])
@pytest.mark.parametrize("column", [0, 1, 2])
def test_masked_values_of_a_recording_are_missing(column, rows):
    columns = [ROWS, STEP, OUTPUT]
    columns[column] = masked(columns[column], *rows)
    flight = dtm.Recording(*columns)
    kept = np.delete(np.arange(40), rows)
    if column == 2:  # the row stays, with what is known of it
        assert np.array_equal(flight.time, ROWS)
        assert np.flatnonzero(np.isnan(flight.output)).tolist() == list(rows)
        assert flight.window(None, None) is flight
        flight = flight.complete()
    elif column == 1:  # it holds where it is missing
        kept = np.arange(40)
    assert np.array_equal(flight.time, ROWS[kept])
    assert np.array_equal(flight.output, OUTPUT[kept])
    assert np.array_equal(flight.reference, STEP[kept])
    assert flight.complete() is flight


@pytest.mark.parametrize("rows", [(10,), (9, 10), (10, 11)])
@pytest.mark.parametrize("column", [0, 1, 2])
def test_a_missing_row_that_hides_a_step_is_refused(column, rows):
    # The step would appear a row later, and the delay a row shorter.
    columns = [ROWS, STEP, OUTPUT]
    columns[column] = masked(columns[column], *rows)
    with pytest.raises(dtm.RecordingError, match="the reference changes in this gap"):
        dtm.Recording(*columns).complete()


def test_a_missing_row_that_hides_a_command_is_refused():
    moving = dtm.Recording(ROWS, STEP, masked(OUTPUT, 5), command=ROWS)
    assert len(moving) == 40
    with pytest.raises(dtm.RecordingError, match="row 5 is missing, and the command changes"):
        moving.complete()
    with pytest.raises(dtm.RecordingError, match="row 5 is missing, and the command changes"):
        dtm.Recording(ROWS, STEP, OUTPUT, command=masked(ROWS, 5))
    held = dtm.Recording(ROWS, STEP, masked(OUTPUT, 5), command=STEP).complete()
    assert len(held) == len(held.command) == 39


def test_not_a_number_is_a_missing_output_and_survives_windows_and_files(tmp_path):
    output = np.where(np.arange(40) == 7, np.nan, OUTPUT)
    flight = dtm.Recording(ROWS, None, output, command=STEP)
    assert not flight.has_reference
    assert flight.steps() == []
    assert "1 without output" in repr(flight)
    flight.save(tmp_path / "run.csv")
    assert dtm.Recording.load(tmp_path / "run.csv") == flight
    assert np.isnan(flight.window(0.3, 2.0).output[4])
    with pytest.raises(dtm.RecordingError, match="has no reference, which this method needs"):
        dtm.estimate_delay(flight, SAMPLED)


def test_masked_columns_of_other_lengths_are_refused():
    with pytest.raises(dtm.RecordingError, match=r"output\[5\] is masked"):
        dtm.Recording(ROWS, STEP, masked(OUTPUT[:-1], 5))


def test_a_masked_recording_gives_the_delay_that_a_clean_one_gives():
    flown = SAMPLED.replace(limit=1.0)
    time = np.arange(100) * 0.065
    step = (time > 0.6).astype(float)
    output = flown.simulate(time, step, reference_time=time).outputs
    known = flown.replace(delay=None)
    spoilt = masked(output, 4, 30, 31, 60)
    fit = dtm.estimate_delay(dtm.Recording(time, step, spoilt), known, free=("delay",))
    assert fit.delay == pytest.approx(0.36, abs=1e-6)
