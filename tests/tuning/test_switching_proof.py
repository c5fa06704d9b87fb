"""Proofs for changing delays and gains, held against loops that are simulated without them."""

import dataclasses
import itertools
import json
import math
from fractions import Fraction
from pathlib import Path

import deadtime as dtm
import mpmath
import numpy as np
import pytest
from deadtime.tuning import SwitchingProof, adaptive_gains
from deadtime.tuning.adaptive._check import _Checker, _plant
from deadtime.tuning.adaptive._claims import Claims
from deadtime.tuning.adaptive._search import proved
from deadtime.tuning.adaptive._switched import switched_loop

REFERENCE = Path(__file__).resolve().parents[1] / "reference"

TS, GAIN, LIMIT = 0.1, 0.9, 1.0
SMOOTH = dtm.DerivativeFilter(30.0, discretisation="tustin")
LOOPS = {
    "P": dtm.ControlLoop(dtm.Integrator(GAIN), dtm.P(1.0), sample_time=TS, limit=LIMIT),
    "filter": dtm.ControlLoop(
        dtm.Integrator(GAIN), dtm.PV(1.0, 0.1, SMOOTH), sample_time=TS, limit=LIMIT
    ),
    "lag": dtm.ControlLoop(
        dtm.Integrator(GAIN, lag=0.15), dtm.PV(1.0, 0.1), sample_time=TS, limit=LIMIT
    ),
}


@pytest.fixture(scope="module")
def schedules():
    return {name: adaptive_gains(loop, (0.0, 0.5), sets=3) for name, loop in LOOPS.items()}


def claims_of(Kp, ages, factors=(1.0,), limit=None, least=1.0):
    return Claims((1.0,), (1.0, 0.0), (1.0, 1.0), TS, Kp, 0.0, None, factors, ages, limit, least,
                  0.0, 0.0, ())  # fmt: skip


class Vehicle:
    """gain/(s (lag s + 1)) at its exact times, obeying commands as they arrive in their order."""

    def __init__(self, lag, position):
        self.lag, self.time, self.held = lag, 0.0, 0.0
        self.position, self.speed = position, 0.0
        self.coming = []

    def advance(self, until):
        while self.coming and self.coming[0][0] <= until:
            arrival, command = self.coming.pop(0)
            self._hold(arrival - self.time)
            self.time, self.held = arrival, command
        self._hold(until - self.time)
        self.time = until

    def _hold(self, passed):
        target = GAIN * self.held
        if self.lag == 0.0:
            self.position += target * passed
            return
        fading = math.exp(-passed / self.lag)
        self.position += target * passed + self.lag * (self.speed - target) * (1.0 - fading)
        self.speed = target + (self.speed - target) * fading


def flown(schedule, lag, position, seed, samples=220):
    """Energies v'Pv and positions; the delays of all commands and the sets are drawn."""
    random = np.random.default_rng(seed)
    proof, sets = schedule.proof, schedule.sets
    form = np.array(proof.form)
    vehicle, filtered = Vehicle(lag, position), np.array([position, 0.0])
    past, energies = [0.0] * 5, []
    last, longest = -math.inf, sets[-1].delays[1]
    block = np.array([[0.0, 30.0], [-30.0, -60.0]])
    left = np.linalg.inv(np.eye(2) - 0.5 * TS * block)
    for k in range(samples):
        vehicle.advance(k * TS)
        y, into = vehicle.position, np.array([0.0, 30.0])
        state = [y] if lag == 0.0 else [y, vehicle.speed + y / lag]
        slope = vehicle.speed
        if proof.filter is not None:
            state += list(filtered)
            ahead = left @ ((np.eye(2) + 0.5 * TS * block) @ filtered + TS * into * y)
            slope = 0.5 * 30.0 * (filtered + ahead)[1]  # the mean over the sample, by Tustin
            filtered = ahead
        z = y + proof.Kv / proof.Kp * slope
        v = np.array(state + past)
        energies.append(v @ form @ v)
        past = [z, *past[:-1]]
        # A command is obeyed from its arrival to that of the next one: that has to be before it is
        # older than the delays of its own set permit.
        number = int(random.integers(len(sets)))
        if last > k * TS + sets[number].delays[1]:
            number = len(sets) - 1
        low, high = sets[number].delays
        high = min(high, longest)
        delay = random.choice([low, high, random.uniform(low, high)])
        last, longest = max(k * TS + delay, last), sets[number].delays[1]
        command = -sets[number].factor * proof.Kp * z
        vehicle.coming.append((last, float(np.clip(command, -LIMIT, LIMIT))))
    return np.array(energies)


@pytest.mark.parametrize("name", LOOPS)
def test_energy_falls_on_every_drawn_flight(schedules, name):
    schedule, lag = schedules[name], 0.15 if name == "lag" else 0.0
    assert schedule.proof.verify() == schedule.proof.step >= 1.0
    for seed, step in enumerate((0.05, 0.5, 1.0) * 2):
        energies = flown(schedule, lag, step, seed)
        assert energies[0] <= 1.0
        assert (np.diff(energies) <= 1e-12 * energies[0]).all()
        assert energies[-1] < 1e-4 * energies[0]


def test_a_gain_that_is_unstable_for_one_delay_is_not_provable():
    # The limit for p whole samples is 2 sin(pi/(4p + 2))/Ts.
    limit = 2.0 * math.sin(math.pi / 18.0) / TS
    assert proved(claims_of(0.6 * limit, ((0, 4),))) is not None
    assert proved(claims_of(1.001 * limit, ((4, 4),))) is None
    assert proved(claims_of(0.4 * limit, ((0, 1), (0, 4)), (3.0, 1.0))) is not None
    assert proved(claims_of(0.4 * limit, ((0, 4), (0, 4)), (3.0, 1.0))) is None


def test_no_proof_where_only_the_changes_are_unstable():
    limit = 2.0 * math.sin(math.pi / 18.0) / TS
    Kp = 0.985 * limit
    for age in range(5):
        assert dtm.ControlLoop(
            dtm.Integrator(), dtm.P(Kp), delay=age * TS, sample_time=TS
        ).is_stable()
        assert proved(claims_of(Kp, ((age, age),))) is not None
    # Whichever age of 0 to 4 drives the vehicle fastest the way it moves: it swings more and more.
    heights, way = [1.0] * 5, -1.0
    for _ in range(400):
        y = heights[-1]
        moves = [-Kp * TS * heights[-1 - age] for age in range(5)]
        heights.append(y + max(moves, key=lambda move: move * way))
        if (heights[-1] - y) * way <= 0.0:
            way = -way
    assert max(map(abs, heights[-50:])) > 3.0
    assert proved(claims_of(Kp, ((0, 4),))) is None


@pytest.mark.parametrize("name", LOOPS)
def test_search_and_check_make_the_same_matrices(schedules, name):
    proof = schedules[name].proof
    found = switched_loop(proof)
    checker = _Checker(proof)
    low, high = (factor * GAIN * proof.Kp for factor in (proof.least_factor, proof.factors[-1]))
    chain = [(1, low), (4, high)] if name == "lag" else [(4, high)]
    exact = checker._matrix([(age, Fraction(gain / proof.Kp)) for age, gain in chain])
    matrix = np.array([[float(one.middle) for one in row] for row in exact])
    assert min(np.abs(matrix - case.matrix).max() for case in found.cases) < 1e-12
    assert max(one.radius for row in exact for one in row) < 1e-25


def test_the_response_lies_in_its_triangle_and_moves_one_way_in_it(schedules):
    plant = _plant(schedules["lag"].proof)
    first, later = ([float(one.middle) for one in share] for share in plant.shares)
    corner = np.column_stack([first, later])
    shares = []
    with mpmath.workdps(40):
        a, b = 1 / mpmath.mpf(0.15), 1 / mpmath.mpf(0.15)
        for t in np.linspace(0.0, TS, 400):
            fading = mpmath.exp(-a * t)
            response = [b * (t / a - (1 - fading) / a**2), b * t]
            shares.append(np.linalg.solve(corner, np.array(list(map(float, response)))))
    shares = np.array(shares)
    # G = passed_1 gamma_1 + passed_2 gamma_2: both rise from 0 to 1, the second behind the first.
    assert np.allclose(shares[[0, -1]], [[0.0, 0.0], [1.0, 1.0]], atol=1e-9)
    assert (np.diff(shares, axis=0) > -1e-9).all()
    assert (shares[:, 1] <= shares[:, 0] + 1e-9).all()


def test_checker_encloses_the_transition(schedules):
    plant = _plant(schedules["lag"].proof)
    with mpmath.workdps(60):
        a = mpmath.mpf(1.0) / mpmath.mpf(0.15)
        exact = mpmath.exp(-a * mpmath.mpf(TS))
        entry = plant.transition[0][0]
        assert mpmath.mpf(entry.low.numerator) / entry.low.denominator <= exact
        assert exact <= mpmath.mpf(entry.high.numerator) / entry.high.denominator
        assert entry.radius < 1e-30


def forgeries(proof):
    """Each number of a proof changed to one that would claim more."""
    yield "Kp", 1.6 * proof.Kp
    yield "Kp", -proof.Kp
    yield "gain", (proof.gain[0], 1.6 * proof.gain[1])
    yield "gain", (-proof.gain[0], proof.gain[1])
    yield "factors", (2.0 * proof.factors[0], *proof.factors[1:])
    yield "factors", (*proof.factors[:-1], math.nan)
    yield "ages", (*proof.ages[:-1], (0, proof.ages[-1][1] + 1))
    yield "ages", (proof.ages[-1], *proof.ages[1:])
    yield "limit", 0.5 * proof.limit
    yield "limit", None
    yield "least_factor", 0.3 * proof.least_factor
    yield "sample_time", 1.7 * proof.sample_time
    yield "step", 1.01 * proof.step
    yield "decay", 5.0
    yield "den", (1.0, 0.1)
    yield "num", (-1.0,)
    for i, j in itertools.combinations_with_replacement(range(len(proof.form)), 2):
        form = [list(row) for row in proof.form]
        form[i][j] = form[j][i] = form[i][j] + 0.5 * max(map(max, proof.form))
        yield "form", tuple(map(tuple, form))
        form[i][j] += 1.0
        if i != j:
            yield "form", tuple(map(tuple, form))


def test_forged_proofs_are_refused(schedules):
    proof = schedules["P"].proof
    for name, value in forgeries(proof):
        with pytest.raises(dtm.CertificateError):
            dataclasses.replace(proof, **{name: value}).verify()


def test_a_proof_is_stored_and_checked_again(schedules):
    for schedule in schedules.values():
        text = schedule.proof.to_json(indent=1)
        again = SwitchingProof.from_json(text)
        assert again == schedule.proof
        assert again.verify() == schedule.proof.step
    data = json.loads(text)
    for change in ({"Kp": 1.0}, {"more": "0x1p0"}, {"format": "other"}, {"Kp": "nan"}):
        with pytest.raises(ValueError, match="not the text of a proof"):
            SwitchingProof.from_json(json.dumps(data | change))


def test_a_file_of_an_earlier_version_is_read_and_written_as_before():
    text = (REFERENCE / "switching_proof.json").read_text(encoding="utf-8")
    read = SwitchingProof.from_json(text)
    assert read.verify() == read.step > 1.0
    assert read.to_json(indent=1) == text.strip()


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("Kp", "0x1p+99999"),  # left as an OverflowError
        ("Kp", "inf"),
        ("Kp", 1),
        ("Kp", True),
        ("ages", [["0x0p+0", 1]]),
        ("ages", [[0, True]]),
        ("ages", [[0, 1, 2]]),
        ("filter", ["0x1p+5", "0x1p+0", "zoh"]),
        ("form", "0x1p+0"),
        ("gain", None),
    ],
)
def test_a_damaged_file_is_refused_with_the_reason(place, value):
    data = json.loads((REFERENCE / "switching_proof.json").read_text(encoding="utf-8"))
    with pytest.raises(ValueError, match="not the text of a proof"):
        SwitchingProof.from_json(json.dumps(data | {place: value}))
    del data[place]
    with pytest.raises(ValueError, match=f"not the text of a proof: .*{place}"):
        SwitchingProof.from_json(json.dumps(data))


def test_nested_brackets_are_no_recursion_error():
    with pytest.raises(ValueError, match="nested"):
        SwitchingProof.from_json("[" * 200_000)


def test_gains_are_lowered_until_there_is_a_proof_or_refused():
    def designed(Kp):
        return dtm.design(
            LOOPS["P"],
            controller=dtm.P,
            delay=(0.0, 0.5),
            ranges={"Kp": (0.999 * Kp, Kp)},
            objective="abscissa",
        )

    # The limit for 0.5 s is 3.16.
    schedule = adaptive_gains(designed(1.86), (0.0, 0.5), sets=2)
    assert 0.3 < schedule.lowered < 0.9
    assert "no proof was found, so the gains were moved" in schedule.summary()
    schedule.proof.verify()
    close = designed(3.14)
    with pytest.raises(dtm.NotProvedError, match="larger gain_margin"):
        adaptive_gains(close, (0.0, 0.5), sets=2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sample_time": None}, "on samples"),
        ({"plant": dtm.FirstOrder(1.0, 1.0)}, "integrator with at most one lag"),
        ({"plant": dtm.FactoredPlant([0.1, 0.2], integrator=True)}, "at most one lag"),
        ({"controller": dtm.PI(1.0, 0.1)}, "P and PV"),
        ({"controller": dtm.PV(1.0, 0.1)}, "Give the controller a filter"),
        ({"controller": dtm.PV(1.0, 0.1, dtm.DerivativeFilter(30.0))}, "tustin"),
        ({"delay_path": "measurement"}, "delay of the command"),
        ({"sample_time": 0.01}, "longer sample time"),
    ],
)
def test_loops_without_a_proof_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        adaptive_gains(LOOPS["P"].replace(**change), (0.0, 0.5))
