"""Every result survives pickle and copy, can be compared, and is read-only."""

import copy
import dataclasses
import json
import pickle
import tempfile
from functools import cache
from pathlib import Path

import deadtime as dtm
import numpy as np
import pytest
from made_logs import copter
from made_processes import bump
from step_recordings import record_step

LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.8, 0.1), delay=0.36, sample_time=0.065)
CONTINUOUS = LOOP.continuous()
SYSTEM = dtm.DelaySystem(A={0.36: -2.0}, B={0.36: 2.0})
Kp, T = dtm.parameters("Kp T")
FAMILY = dtm.s + Kp * dtm.delay(T)
RANGES = {"Kp": (0.5, 3.0), "T": (0.1, 0.5)}
h = dtm.s + (2.0 + 0.3 * dtm.s) * dtm.delay(0.36)


def solved(**more):
    events = [lambda t, y: y[0]]
    return dtm.solve_dde(
        lambda t, y, z: -z[0], (0.0, 3.0), 1.0, 1.0, events=events, dense_output=True, **more
    )


def designed():
    return dtm.design(
        LOOP, ranges={"Kp": (0.5, 3), "Kv": (0, 0.5)}, shape=(5, 5), objective="abscissa"
    )


def estimated():
    return dtm.estimate_delay(*record_step(rest=1.0, noise=0.01), free=("delay",))


def found_plant():
    time, command, output = bump(rows=150)
    return dtm.estimate_delay(dtm.Recording(time, None, output, command), plant="lag")


@cache
def tuned():
    return dtm.tune(found_plant(), controller=dtm.P)


def tracked():
    time = 0.065 * np.arange(12)
    return dtm.estimation.online(dtm.Recording(time, time, time, time), LOOP, noise=0.01)


def planned(**more):
    return dtm.identifiability(LOOP, dtm.Experiment.step(1.0, 5.0), noise=0.01, **more)


def lag_of(lag):
    return [1.0], [lag, 1.0]


def logged():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.bin"
        path.write_bytes(copter().data)
        return dtm.open_log(path)


def adapted():
    pytest.importorskip("clarabel", reason="the form of a proof is searched with clarabel")
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), sample_time=0.1)
    return dtm.tuning.adaptive_gains(loop, (0.0, 0.2), sets=2)


#: An expression for one object of every public type that is not an error or a plain number.
MADE = {
    "Choice": lambda: dtm.tuning.Choice(1, True),
    "Certificate": lambda: h.certify((-1, 1), (0, 9)),
    "BackCalculation": lambda: dtm.loops.BackCalculation(2.0),
    "Chain": lambda: h.chains()[0],
    "ConditionalIntegration": dtm.loops.ConditionalIntegration,
    "ControlLoop": lambda: LOOP,
    "Explorer": lambda: LOOP.explore(),
    "CramerRaoBound": lambda: dtm.estimation.CramerRaoBound(**bound_fields()),
    "Crossings": lambda: dtm.crossings(FAMILY, {"Kp": (0.1, 9.0)}, at={"T": 0.3}),
    "DelayEstimate": lambda: dtm.estimate_delay(
        *record_step(rest=1.0, noise=0.01), free=("delay",)
    ),
    "LoadResponse": lambda: LOOP.load_response(),
    "DelayTrack": tracked,
    "OnlineEstimate": lambda: tracked().last,
    "DelayResult": solved,
    "DelaySolution": lambda: solved().sol,
    "DelaySystem": lambda: SYSTEM,
    "DerivativeFilter": lambda: dtm.DerivativeFilter(30.0),
    "Design": designed,
    "Expansion": lambda: h.expansion(0.5j, 3),
    "Experiment": lambda: dtm.Experiment.step(1.0, 5.0),
    "FilterChoice": lambda: dtm.design_filter(
        LOOP, fixed={"Kp": 1.5}, omegas=[20.0, 40.0], loss=0.9
    ),
    "FirstOrder": lambda: dtm.FirstOrder(1.0, 0.3),
    "FlightNoise": lambda: dtm.experiments.FlightNoise(0.01, air=0.1, air_time=0.3),
    "FittedRecording": lambda: found_plant().runs[0],
    "FittedRun": lambda: dtm.estimate_delay(
        *record_step(rest=1.0, noise=0.01), free=("delay",)
    ).runs[0],
    "FactoredPlant": lambda: dtm.FactoredPlant([0.2, 0.1], zero=0.05),
    "GainSchedule": adapted,
    "Gate": lambda: dtm.check_gains(CONTINUOUS, {"Kp": 1.5}),
    "RuleTable": lambda: dtm.tuning.rules(CONTINUOUS),
    "RuleFigures": lambda: dtm.tuning.rules(CONTINUOUS).rows[0],
    "GainSet": lambda: adapted().robust,
    "Identifiability": planned,
    "IdealForm": lambda: dtm.tuning.IdealForm(2.0, 8.0),
    "SeriesForm": lambda: dtm.tuning.SeriesForm(2.0, 8.0),
    "ParallelForm": lambda: dtm.tuning.ParallelForm(2.0, 8.0),
    "Settings": lambda: dtm.tuning.settings_of(dtm.PI(2.0, 0.1), "ideal"),
    "Integrator": dtm.Integrator,
    "LeastMargins": lambda: dtm.tuning.LeastMargins(2.0, 45.0, 0.1, 1.6, 1.2),
    "Log": logged,
    "LogLoop": lambda: logged().loops["roll"],
    "Margins": CONTINUOUS.margin,
    "MonteCarlo": lambda: planned().monte_carlo(3, processes=1, noise_in_loop=False),
    "P": lambda: dtm.P(2.0),
    "PD": lambda: dtm.PD(2.0, 0.1),
    "PI": lambda: dtm.PI(2.0, 0.1),
    "PID": lambda: dtm.PID(2.0, 0.1, 0.1),
    "PV": lambda: dtm.PV(2.0, 0.1),
    "ParametricPlant": lambda: dtm.ParametricPlant(lag_of, {"lag": 0.3}),
    "Parameter": lambda: Kp,
    "ParametricQuasiPolynomial": lambda: FAMILY,
    "PlannedBound": lambda: planned().bound,
    "Advice": lambda: found_plant().advice(),
    "Cause": lambda: dtm.estimation.Cause("play", 0.05, (0.04, 0.06), None, 20.0),
    "SensorFault": lambda: dtm.estimation.SensorFault("smoothed", 0, 12, 3.0, 4.0, 5.0),
    "LoopView": lambda: found_plant().at([0.01, 0.1]),
    "PlantCandidate": lambda: found_plant().best,
    "PlantEstimate": found_plant,
    "PlantChoice": lambda: dtm.estimation.PlantChoice(
        {"1 lag": estimated()}, {"1 lag": 0.0}, {}, "1 lag"
    ),
    "Prediction": lambda: tuned().load,
    "Proposal": tuned,
    "ProvedBoxes": lambda: dtm.proved_boxes(FAMILY, RANGES, tol=0.3),
    "QuasiPolynomial": lambda: h,
    "PlantWithDelays": lambda: dtm.loops.PlantWithDelays(1.0 / (dtm.s + dtm.delay(1.0))),
    "RateLimited": lambda: dtm.RateLimited(dtm.Integrator(), rate=1.0, rate_of_rate=5.0),
    "RationalPlant": lambda: dtm.RationalPlant([1.0], [1.0, 1.0]),
    "Recording": lambda: dtm.Recording(
        np.arange(9.0), np.zeros(9), np.zeros(9), units={"output": "m"}
    ),
    "Response": LOOP.step_response,
    "RobustMap": lambda: dtm.robust_map(
        CONTINUOUS, {"Kp": (0.5, 3), "Kv": (0, 0.5)}, {"delay": (0.3, 0.4)}, shape=(3, 3)
    ),
    "RootSet": LOOP.rightmost,
    "RootSensitivity": lambda: h.root_sensitivity(h.rightmost()[0]),
    "StabilityMap": lambda: dtm.stability_map(FAMILY, RANGES, shape=(3, 3)),
    "Tile": lambda: dtm.stability.tiles(FAMILY, RANGES, (4, 4), (2, 2))[0, 1],
    "Tiles": lambda: dtm.stability.tiles(FAMILY, RANGES, (4, 4), (2, 2)),
    "StabilityRadius": lambda: dtm.stability_radius(FAMILY, {"Kp": 1.0, "T": 0.3}),
    "Step": lambda: dtm.recordings.Step(1, 0.1, 0.0, 1.0),
    "Series": lambda: logged().loops["roll"].setpoint,
    "SwitchingProof": lambda: adapted().proof,
    "Sweep": lambda: dtm.sweep(LOOP, {"Kp": np.array([1.0, 2.0])}),
    "Response of a system": lambda: SYSTEM.step_response([0.0, 0.5, 1.0]),
    "Trade": lambda: dtm.tuning.Trade("fixed", 1.0, float("nan"), True, 1.0, "so"),
    "TransferFunction": lambda: dtm.feedback(2.0 / dtm.s * dtm.delay(0.36)),
    "SharedNumber": lambda: dtm.estimation.shared_number([estimated(), estimated()]),
    "Whiteness": lambda: dtm.estimation.Whiteness(1.0, 0.5, 3, 0.1),
}
WAYS = {
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}


def bound_fields():
    bound = planned().bound
    return {
        field.name: getattr(bound, field.name)
        for field in dataclasses.fields(dtm.estimation.CramerRaoBound)
    }


#: The packages whose results are checked; the later ones run loops and return what these define.
PACKAGES = (
    "special", "dde", "roots", "systems", "loops", "stability", "recordings", "experiments",
    "estimation", "tuning",
)  # fmt: skip


def public_types():
    """Every type of these packages but errors, numbers and the options of estimation methods."""
    others = (BaseException, int, dtm.estimation.Method)
    for package in (getattr(dtm, name) for name in PACKAGES):
        for kind in (getattr(package, name) for name in package.__all__):
            if isinstance(kind, type) and not issubclass(kind, others):
                yield kind


def test_the_list_of_types_is_complete():
    # Base classes that are never instantiated, tuples of arrays, what has a test of its own, and
    # what goes on with each row.
    assert {kind.__name__ for kind in public_types()} - MADE.keys() == {
        "Controller", "Plant", "OffsetW", "NoiseModel", "DisturbanceModel",
        "Comparison", "MethodDifference", "ConfidenceRegion", "RecordingCheck", "Finding", "Hole",
        "SentCommands", "OnlineEstimator", "GainFollower",
    }  # fmt: skip


@pytest.fixture(scope="module", params=MADE)
def one(request):
    return MADE[request.param]()


def values_of(one):
    if dataclasses.is_dataclass(one):
        for field in dataclasses.fields(one):
            value = getattr(one, field.name)
            yield field.name, value
            if isinstance(value, dict):
                yield from ((f"{field.name}[{key}]", part) for key, part in value.items())


@pytest.mark.parametrize("way", WAYS)
def test_every_public_object_survives_copying_equal_to_itself(one, way):
    # Solutions of delay equations could not be copied, and a copied result was not equal to it.
    other = WAYS[way](one)
    assert type(other) is type(one)
    assert repr(other) == repr(one)
    assert other == one


def test_no_comparison_raises(one):
    # `RootSet == array` raised where the lengths differ.
    if isinstance(one, tuple):
        return  # tuples compare as tuples
    for foreign in (None, 1, "a", np.zeros(2), np.zeros((3, 1)), [1.0], object()):
        assert not np.any(one == foreign)
    if isinstance(one, dtm.roots.RootSet):
        assert (np.zeros(7) == one) is False
        assert (np.zeros(7) != one) is True
    hash(one)


def test_nothing_in_a_result_can_be_changed(one):
    # The dicts of a fit could be changed once, which changed the fit.
    if not (dataclasses.is_dataclass(one) and hasattr(one, "_freeze")):
        return
    for way in (lambda it: it, *WAYS.values()):
        for name, value in values_of(way(one)):
            if isinstance(value, np.ndarray):
                assert not value.flags.writeable, name
            elif isinstance(value, dict):
                for change in ("clear", "popitem", "update", "setdefault"):
                    with pytest.raises(TypeError, match="cannot be changed"):
                        getattr(value, change)()
                with pytest.raises(TypeError, match="cannot be changed"):
                    value["a"] = 1
                assert dict(value) == value
                assert json.loads(json.dumps(dict.fromkeys(value, 1))).keys() == value.keys()


def test_results_that_differ_are_not_equal():
    one, other = LOOP.step_response(), LOOP.replace(delay=0.3).step_response()
    assert one != other
    assert one == LOOP.step_response()
    assert len({one, LOOP.step_response(), other}) == 2
    assert solved() == solved()
    assert solved().sol != solved(rtol=1e-3).sol


def test_a_copied_solution_gives_the_same_values():
    found = solved()
    times = np.linspace(-1.0, 3.0, 101)
    for way in WAYS.values():
        other = way(found)
        for nu in (0, 1):
            assert np.array_equal(other.sol(times, nu=nu), found.sol(times, nu=nu))


def test_parts_that_are_no_solution_are_refused():
    kind, parts = solved().sol._pieces.__reduce__()
    dim, end, starts, ends, terms, coefficients = parts
    for wrong in (
        (dim, end, starts[1:], ends, terms, coefficients),
        (dim, end, starts, ends, terms + np.uint64(1), coefficients),
        (dim, end, starts, ends, terms, coefficients[:-1]),
        (2**60, end, starts, ends, terms, coefficients),
        (0, end, starts, ends, terms, coefficients),
    ):
        with pytest.raises(ValueError, match="the pieces of the solution are not valid"):
            kind(*wrong)
