"""Stable ranges of drawn sampled loops, every number of each, against eigenvalues."""

import math

import deadtime as dtm
import numpy as np
import pytest
from scipy import linalg

#: Most samples in the delay of a loop whose matrix is decomposed.
SAMPLES = 100


def plant(rng, log):
    """One of seven structures; the fifth has two light modes."""
    gain, kind = log(0.3, 3.0), rng.integers(0, 7)
    pair = {"pole_frequency": log(2.0, 80.0), "pole_damping": log(0.003, 0.9)}
    if kind == 0:
        return dtm.Integrator(gain, rng.choice([0.0, log(0.02, 0.5)]))
    if kind == 1:
        return dtm.FirstOrder(gain, log(0.1, 3.0))
    if kind == 2:
        lags, zero = [log(0.05, 1.0), log(0.02, 0.5)], log(0.01, 0.2)
        zero = float(rng.choice([0.0, zero, -zero]))
        return dtm.FactoredPlant(lags, gain, zero, integrator=bool(rng.integers(0, 2)))
    if kind == 3:
        return dtm.FactoredPlant([log(0.05, 1.0)], gain, **pair)
    if kind == 4:
        return dtm.FactoredPlant(gain=gain, **pair)
    if kind == 5:
        modes = [(log(3.0, 40.0), log(0.002, 0.05)), (log(20.0, 200.0), log(0.002, 0.05))]
        first, second = ([1.0, 2.0 * z * w, w * w] for w, z in modes)
        num = np.polymul(first, second)
        for share, (w, _), other in zip((0.05, 0.01), modes, (second, first), strict=True):
            num = np.polyadd(num, share * np.polymul([w * w * log(0.01, 0.5), 0.0], other))
        den = np.polymul([log(0.1, 1.0), 1.0], np.polymul(first, second))
        return dtm.RationalPlant(gain * num, den)
    return dtm.ParametricPlant(
        lambda m, c: ([1.0], [m, c, 0.0]), {"m": log(0.3, 3.0), "c": log(0.1, 2.0)}
    )


def controller(rng, log):
    rule = rng.integers(0, 5)
    smooth = None
    if rule > 0:
        name = (None, None, "hold", "tustin", "backward")[rule]
        smooth = dtm.DerivativeFilter(log(5.0, 100.0), log(0.2, 1.5), name)
    Kp, Kd, kind = log(0.05, 3.0), log(0.01, 0.5), rng.integers(0, 5)
    if kind == 0:
        return dtm.P(Kp)
    if kind == 1:
        return dtm.PI(Kp, log(1e-4, 1.0))
    if kind == 2:
        return dtm.PV(Kp, Kd, smooth)
    if kind == 3:
        return dtm.PD(Kp, Kd, smooth)
    return dtm.PID(Kp, log(1e-3, 1.0), Kd, smooth)


def stable_loop(seed):
    """A loop of this seed, of a smaller gain where it would be unstable; None where that is too."""
    rng = np.random.default_rng([45, seed])

    def log(low, high):
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    delay = float(rng.choice([0.0, log(0.005, 0.5)]))
    loop = dtm.ControlLoop(
        plant(rng, log), controller(rng, log), delay=delay, sample_time=log(0.005, 0.2)
    )
    for share in (1.0, 0.1, 0.01):
        tried = loop.replace(gain=share * loop.parameters["gain"])
        if rightmost(tried)[0] < 1.0 - 1e-9:
            return tried
    return None


def rightmost(loop, **changes):
    """The largest modulus of an eigenvalue, and what rounding may change in it to first order."""
    matrix = loop.replace(**changes).transition_matrix()
    with np.errstate(invalid="ignore"):  # units beyond integers, read as places as well
        balanced, _ = linalg.matrix_balance(matrix, permute=False)
    z, left, right = linalg.eig(balanced, left=True, right=True)
    with np.errstate(divide="ignore"):
        overlap = np.abs(np.sum(left.conj() * right, axis=0))
        errors = len(balanced) * np.finfo(float).eps * np.linalg.norm(balanced) / overlap
    largest = int(np.argmax(np.abs(z)))
    return abs(z[largest]), errors[largest]


def has_few_samples(loop, name, value):
    delay = value if name == "delay" else loop.delay
    return delay <= SAMPLES * (value if name == "sample_time" else loop.sample_time)


def is_decided(loop, **changes):
    """Whether stability can be proved; where not, an end of a gain has three digits."""
    return loop.replace(**changes).specification.native.is_stable() is not None


def between(value, end, size):
    """Values from the present one to an end, dense next to it; far where it is infinite."""
    far = math.copysign(1e4 * size, end) if math.isinf(end) else end
    if far == 0.0 and value > 0.0:
        far = 1e-5 * value
    if far * value > 0.0:
        spread = np.geomspace(value, far, 120)[1:-1]
    else:
        spread = np.linspace(value, far, 120)[1:-1]
    return np.concatenate([spread, far - (far - value) * np.geomspace(1e-6, 0.1, 12)])


def faults(loop, name, low, high):
    """Where eigenvalues say that a loop is unstable in a range, or not lost at its end."""
    value = loop.parameters[name]
    size = abs(value) if value != 0.0 else loop.sample_time
    for end in (low, high):
        if end == value:
            continue
        for point in between(value, end, size).tolist():
            if abs(point) > 1e-8 * size and has_few_samples(loop, name, point):
                found, error = rightmost(loop, **{name: point})
                if found - 1.0 > 1e-9 + error and is_decided(loop, **{name: point}):
                    yield f"{name}={point}: abs(z) - 1 = {found - 1.0:.2e} in ({low}, {high})"
                    break
        if math.isinf(end) or abs(end) <= 1e-11 * size or not has_few_samples(loop, name, end):
            continue
        beyond = math.copysign(abs(end), end - value)
        parts = (1e-8, 1e-6, 1e-4) if is_decided(loop, **{name: end + 1e-4 * beyond}) else (2e-3,)
        past = [rightmost(loop, **{name: end + part * beyond}) for part in parts]
        if all(found + 10.0 * error < 1.0 for found, error in past):
            yield f"{name}: stable beyond {end}"


def survey(seeds):
    """Every range of these loops: the faults, the number of ranges, and those refused."""
    wrong, asked, refused = [], 0, []
    for loop in filter(None, map(stable_loop, seeds)):
        for name in loop.parameters:
            asked += 1
            try:
                low, high = loop.stable_range(name)
            except ValueError as error:
                refused.append((loop, name, str(error)))
                continue
            wrong += [(loop, fault) for fault in faults(loop, name, low, high)]
    return wrong, asked, refused


def test_ranges_of_some_loops_are_those_of_eigenvalues():
    wrong, asked, refused = survey([2, 9, 10])
    assert not wrong
    assert not refused
    assert asked == 20


def test_the_end_of_a_gain_has_its_digits_where_the_polynomials_lose_some():
    """It had three: the interval of the crossing was not made shorter."""
    loop = stable_loop(135)
    low, _ = loop.stable_range("Kp")
    assert rightmost(loop, Kp=low * (1.0 - 1e-6))[0] > 1.0 > rightmost(loop, Kp=low * 1.000001)[0]


@pytest.mark.survey
@pytest.mark.long
@pytest.mark.parametrize("part", range(6))
def test_ranges_of_three_hundred_loops_are_those_of_eigenvalues(part):
    wrong, asked, refused = survey(range(52 * part, 52 * part + 52))
    assert not wrong
    assert asked > 300
    # Of polynomials of degree seven or eight, and where a light mode turns many times in a sample.
    assert len(refused) < 0.05 * asked
    words = ("stability is not known", "was stable in", "double precision")
    assert all(any(word in message for word in words) for _, _, message in refused)
