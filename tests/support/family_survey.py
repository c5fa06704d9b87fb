"""What a survey of made records counts: kinds, verdicts, intervals, widths and cost."""

import os
import time
from dataclasses import dataclass, field

import numpy as np
from deadtime.estimation import _native

#: Records of each kind: 500 for the figures that are promised, a few to see that all is in place.
CASES = int(os.environ.get("DEADTIME_CASES", "6"))

#: The first of their seeds: figures are those of records that nothing was tuned to.
FIRST = int(os.environ.get("DEADTIME_FIRST", "0"))
SEEDS = range(FIRST, FIRST + CASES)

#: Names of the classes by integrators, zeros and lags.
NAMES = {
    (False, 0, 1): "lag",
    (False, 0, 2): "two lags",
    (True, 0, 2): "integrator, lag",
    (True, 1, 3): "integrator, two lags, zero",
}

#: Lead in BIC that is clear.
CLEAR = 10.0


def fit_rows(time, command, output, earlier=0, **options):
    return _native.fit_family([(time, command, output, earlier, None, 0.0)], **options)


def fit(record, **options):
    rows = (record.time, record.command, record.output)
    return fit_rows(*rows, closed_loop=record.in_loop, **options)


def name_of(record):
    """The class of the plant that made the record."""
    return NAMES[record.integrates, len(record.num) - 1, len(record.den) - 1]


def holds(interval, value):
    return interval[0] <= value <= interval[1]


def width(interval):
    return interval[1] - interval[0]


def held(found, record):
    """Which of the quantities that a loop feels lie in their intervals."""
    omega = found.crossover
    # The phase is the equivalent delay, for either kind of plant.
    truth = {
        "largest_gain": record.largest_gain,
        "gain_at_crossover": abs(record.response(omega)),
        "phase_at_crossover": record.phase(omega)[0],
    }
    return {name: holds(found.hull[name], value) for name, value in truth.items()}


@dataclass
class Survey:
    """Counts over records of one kind."""

    cases: int = 0
    wrong: int = 0
    reliable: int = 0
    hits: list = field(default_factory=list)
    ratios: list = field(default_factory=list)
    cpu: list = field(default_factory=list)

    def add(self, record):
        begin = time.process_time()
        found = fit(record)
        self.cpu.append(time.process_time() - begin)
        self.cases += 1
        own = [one.bic for one in found.candidates if one.integrating == record.integrates]
        self.wrong += found.candidates[0].bic < min(own) - CLEAR
        if found.verdict != "reliable":
            return
        self.reliable += 1
        self.hits.append(list(held(found, record).values()))
        named = fit(record, plant=name_of(record))
        views = [one.at([found.crossover]) for one in (found, named)]
        ratio = [width(one.hull["largest_gain"]) for one in (found, named)]
        self.ratios.append(
            [ratio[0] / ratio[1]]
            + [
                np.divide(*[width((view[name][1][0], view[name][2][0])) for view in views])
                for name in ("gain", "phase")
            ]
        )

    def report(self, kind):
        hits, ratios = np.mean(self.hits, axis=0), np.median(self.ratios, axis=0)
        return (
            f"{kind}: {self.cases} records, wrong kind {self.wrong}, reliable {self.reliable}; "
            f"largest gain, gain and phase at crossover held {np.round(hits, 3).tolist()}, "
            f"width over that of the right plant {np.round(ratios, 2).tolist()}, "
            f"CPU {np.median(self.cpu):.2f} s"
        )


def surveyed(kind):
    out = Survey()
    for seed in SEEDS:
        out.add(kind(seed))
    return out


def least_squares_errors(record, noise=0.003, delay=0.3, lag=5.0):
    """Standard errors of delay, gain and lag by least squares with a free start.

    The class and the noise are known, and rows up to the delay are left out.
    """
    time, command = record.time, record.command
    used = time >= time[0] + delay

    def parts(late, slow):
        edges = np.r_[time[0], time[1:] + late]
        after = np.maximum(time[:, None] - edges[None, :], 0.0)
        forced = (1.0 - np.exp(-after / slow)) @ np.diff(command, prepend=0.0)
        return np.c_[forced, np.exp(-(time - time[0]) / slow)][used]

    def model(values):
        late, gain, slow, start = values
        return parts(late, slow) @ [gain, start]

    gain, start = np.linalg.lstsq(parts(delay, lag), record.output[used], rcond=None)[0]
    at = np.array([delay, gain, lag, start])
    steps = 1e-5 * np.eye(4)
    slopes = np.array([(model(at + step) - model(at - step)) / 2e-5 for step in steps]).T
    return noise * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))[:3]
