"""How often `dtm.latency` holds the truth of made logs, and how wide its intervals are.

``python tests/support/latency_survey.py --runs 40 --seed 1`` prints a row for each case of
`flown_cases`, what was said of those that are not reliable, and whether the limits hold.
``--cases 3,7`` takes some of them; ``--keep FILE`` writes each answer there, and a later run goes
on with those that it holds.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import deadtime as dtm
import numpy as np
from deadtime.logs import LoopLatency
from flown_cases import CASES
from flown_files import SUFFIXES
from flown_logs import fly
from latency_bound import bound_of
from scipy import stats

#: Limits: wrong intervals of all that are reliable, and of one case in `RUNS` logs; their width
#: over that of the bound; and the share that is reliable where the bound is below `TELLS`.
WRONG, WRONG_OF_A_CASE, RUNS, WIDE, RELIABLE = 0.06, 7, 40, 1.5, 0.7

#: Cases of each format whose logs are short to read and to fit, a third of them with jumps as of
#: all: those of the test.
CASES_OF_THE_TEST = (0, 3, 9, 10, 15, 18, 22, 28)

#: A log tells its time if half the interval of the bound is below this share of it.
TELLS = 0.2

#: Half an interval of 95 % in standard errors.
TWO_SIDED = 1.96

#: Numbers with their units, which differ in sentences that say the same.
NUMBERS = re.compile(r"[-−+]?\d[\d.,e]*(?:[-+]\d+)?(?:\s?(?:%|ms|µs|s|Hz|ppm|deg/s|rad/s)\b)?")


@dataclass(frozen=True)
class Answer:
    """What came out of one log, in s.

    `verdict` is ``"none"`` where the loop was refused, and ``"failed"`` where an error was raised.
    """

    case: int
    seed: int
    truth: float
    bound: float
    block: float
    verdict: str
    time: float
    low: float
    high: float
    reason: str
    seconds: float

    @property
    def is_held(self) -> bool:
        """Whether the interval holds the truth."""
        return self.low <= self.truth <= self.high

    @property
    def width(self) -> float:
        """Half the interval over that of the bound."""
        return 0.5 * (self.high - self.low) / (TWO_SIDED * self.bound)

    @property
    def tells(self) -> bool:
        """Whether the bound is small against the time."""
        return TWO_SIDED * self.bound < TELLS * self.truth


def answer(number: int, seed: int) -> Answer:
    """The answer to one log of a case."""
    case = CASES[number]
    flown = fly(case, seed)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"flown{SUFFIXES[case.writer]}"
        path.write_bytes(flown.data(np.random.default_rng([seed, number, 1])))
        start = time.process_time()
        try:
            loop = dtm.latency(path, loops=[case.loop]).loop(case.loop, "setpoint")
        except Exception as error:  # whatever it is, it is an answer that nobody can use
            loop, why = None, f"{type(error).__name__}: {error}"
        seconds = time.process_time() - start
    seen = () if loop is None or loop.verdict == "none" else (loop.frequencies, loop.weights)
    said = ("failed", np.nan, np.nan, np.nan, why) if loop is None else _said(loop)
    bound = bound_of(flown, *seen)
    truth = flown.plant.time
    if seen:
        truth = float(flown.plant.delay_at(loop.frequencies) @ loop.weights)
    return Answer(number, seed, truth, bound.error, bound.block, *said, seconds)


def _said(loop: LoopLatency) -> tuple[str, float, float, float, str]:
    """Verdict, time, interval and reason of a loop."""
    return loop.verdict, loop.time, *loop.interval, loop.reason


def answers(jobs: Iterable[tuple[int, int]], workers: int) -> Iterator[Answer]:
    """The answers to these cases and seeds, as they come."""
    jobs = list(jobs)
    if workers == 1:
        yield from (answer(*job) for job in jobs)
        return
    # Two logs at once are faster than one log on two threads.
    for name in ("DEADTIME_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        running = [pool.submit(answer, *job) for job in jobs]
        yield from (done.result() for done in as_completed(running))


def _median(values: list[float]) -> float:
    return float(np.median(values)) if values else np.nan


def row_of(name: str, found: list[Answer]) -> str:
    """A row of the table."""
    reliable = [each for each in found if each.verdict == "reliable"]
    tell = [each for each in found if each.tells]
    counts = Counter(each.verdict for each in found)
    share = np.mean([each.verdict == "reliable" for each in tell]) if tell else np.nan
    return (
        f"{name:50s}{len(found):5d}{len(reliable):9d}{sum(each.is_held for each in reliable):6d}"
        f"{counts['indication']:7d}{counts['none']:6d}"
        f"{_median([each.width for each in reliable]):8.2f}"
        f"{_median([TWO_SIDED * each.bound / each.truth for each in found]):8.3f}"
        f"{len(tell):6d}{share:7.2f}{np.mean([each.seconds for each in found]):8.2f}"
    )


HEAD = (
    f"{'case':50s}{'n':>5s}{'reliable':>9s}{'held':>6s}{'indic.':>7s}{'none':>6s}{'width':>8s}"
    f"{'bound':>8s}{'tell':>6s}{'share':>7s}{'CPU s':>8s}"
)


def table(found: list[Answer]) -> str:
    """A row for each case and one for all, then what was said of answers that are not reliable.

    `width` is the median of half the reliable intervals over that of the bound, `bound` half the
    interval of the bound over the time, `tell` how many logs have one below `TELLS`, and `share`
    which part of those is reliable.
    """
    lines = [HEAD]
    for number, case in enumerate(CASES):
        own = [each for each in found if each.case == number]
        if own:
            lines.append(row_of(f"{number:2d} {case.name}, {case.plant}", own))
    lines.append(row_of("all", found))
    said: Counter[tuple[str, str]] = Counter()
    of_them: Counter[tuple[str, str]] = Counter()
    for each in found:
        for reason in filter(None, each.reason.split("; ")):
            key = each.verdict, NUMBERS.sub("#", reason)
            said[key] += 1
            of_them[key] += each.tells
    lines += ["", "said of how many, and of how many whose log tells its time:"]
    lines += [
        f"{count:5d}{of_them[key]:5d}  {key[0]}: {key[1]}" for key, count in said.most_common()
    ]
    return "\n".join(lines)


def broken(found: list[Answer], alarm: float = 0.5) -> list[str]:
    """Limits that do not hold, in words.

    `alarm` is the probability with which logs that are just as the limits ask break one of the
    limits of a share: a half for the many of a long survey, less for a few.
    """
    reliable = [each for each in found if each.verdict == "reliable"]
    wrong = [each for each in reliable if not each.is_held]
    tell = [each for each in found if each.tells]
    said = []
    if failed := sum(each.verdict == "failed" for each in found):
        said.append(f"{failed} of {len(found)} logs raise an error")
    if len(wrong) > stats.binom.isf(alarm, len(reliable), WRONG):
        said.append(f"{len(wrong)} of {len(reliable)} reliable intervals do not hold the truth")
    for number, count in sorted(Counter(each.case for each in wrong).items()):
        runs = sum(each.case == number for each in found)
        if count > max(1.0, WRONG_OF_A_CASE * runs / RUNS):
            said.append(f"{count} of {runs} logs of case {number} are reliable and wrong")
    if (width := _median([each.width for each in reliable])) > WIDE:
        said.append(f"half the reliable intervals are wider than {width:.2f} times the bound")
    kept = sum(each.verdict == "reliable" for each in tell)
    if kept < stats.binom.ppf(alarm, len(tell), RELIABLE):
        said.append(f"only {kept} of {len(tell)} logs that tell their time are reliable")
    return said


def kept_in(path: Path | None) -> list[Answer]:
    """The answers that a file holds, one in a line."""
    if path is None or not path.exists():
        return []
    return [Answer(**json.loads(line)) for line in path.read_text().splitlines()]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", help="numbers with commas between; all without")
    parser.add_argument("--runs", type=int, default=RUNS, help="logs of each case")
    parser.add_argument("--seed", type=int, default=1, help="that of the first log")
    parser.add_argument("--workers", type=int, default=2, help="logs at once")
    parser.add_argument("--keep", type=Path, help="file of answers to go on with")
    options = parser.parse_args()
    cases = range(len(CASES))
    if options.cases:
        cases = [int(each) for each in options.cases.split(",")]
    seeds = range(options.seed, options.seed + options.runs)
    # Seed by seed, so that a run that is stopped has seen every case.
    wanted = [(case, seed) for seed in seeds for case in cases]
    found = [each for each in kept_in(options.keep) if (each.case, each.seed) in set(wanted)]
    has = {(each.case, each.seed) for each in found}
    for each in answers((job for job in wanted if job not in has), options.workers):
        found.append(each)
        if options.keep:
            with options.keep.open("a") as file:
                file.write(json.dumps(asdict(each)) + "\n")
    print(table(found))
    said = broken(found)
    print("\n".join(["", *said] if said else ["", "all limits hold"]))
    return 1 if said else 0


if __name__ == "__main__":
    sys.exit(main())
