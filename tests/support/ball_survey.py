"""Counts, roots and rightmost roots of random hard functions against ball arithmetic.

``python tests/support/ball_survey.py --cases 10000 --seed 1`` prints every case whose answers
differ and a table at the end; ``--only NUMBER`` repeats one case and prints the function.
"""

import argparse
import contextlib
import signal
import time
from collections import Counter

import deadtime as dtm
import numpy as np
from ball_count import EXACT_BITS, BallCounter, OnContourError, TooManyPiecesError, precision
from deadtime._base.errors import ContourError
from flint import arb
from hard_functions import hard_function

# A root whose relative distance to the edge is smaller than this justifies a refusal.
NEAR = 1e-9

# Questions of the survey, in the order of the table.
QUESTIONS = ("count", "half plane", "sum of roots", "discs", "beside a root", "rightmost")


class Package:
    """Calls the package and measures the total time."""

    def __init__(self):
        self.seconds = 0.0

    def __call__(self, ask):
        """The value or the error of a call."""
        start = time.perf_counter()
        try:
            return ask()
        except (ValueError, RuntimeError, dtm.DeadtimeError) as error:
            return error
        finally:
            self.seconds += time.perf_counter() - start


def refusal(counter, error):
    """The reason for a refusal of the package.

    'near': a root lies where the error says. 'drowned': no root lies there, but the rounding error
    of the terms in double precision is above 1/16 of |h| there. 'clear': neither holds.
    """
    if not isinstance(error, ContourError):
        return f"refused: {type(error).__name__}"
    place = error.place
    try:
        if counter.disc(place, NEAR * max(abs(place), 1e-300)) > 0:
            return "refused near"
    except OnContourError:
        return "refused near"
    drowned = counter.condition(place) * 2.0**-53 > 1 / 16
    return "refused drowned" if drowned else "refused clear"


def region_count(counter, case):
    """The ball count of the case's region, real roots on its edge included."""
    if case.im[0] == 0.0:
        return counter.upper_rectangle(case.re, case.im[1])
    return counter.rectangle(case.re, case.im)


def discs_right(counter, found):
    """Whether the discs are disjoint and each contains as many roots as its multiplicity."""
    for k, (z, r, m) in enumerate(
        zip(found.roots.tolist(), found.radii.tolist(), found.multiplicities.tolist(), strict=True)
    ):
        gaps = np.abs(found.roots - z) - found.radii - r
        if (np.delete(gaps, k) < 0).any():
            return f"the disc about {z} meets another"
        # An exact root at 0, and conjugate roots.
        if r == 0.0 or (z.imag < 0 and z.conjugate() in found.roots):
            continue
        held = None
        for sides in (4, 32):
            with contextlib.suppress(OnContourError):
                held = counter.disc(z, r, sides)
                if held == m:
                    break
        if held != m:
            return f"the disc about {z} of radius {r} holds {held}, not {m}"
    return None


def beside_a_root(case, found):
    """The region with one edge at a root, 0.1 to 1e4 radii beside it."""
    rng = np.random.default_rng(case.number)
    k = rng.integers(len(found))
    away = max(found.radii[k], 1e-300) * 10.0 ** rng.uniform(-1, 4) * rng.choice([-1.0, 1.0])
    z = found[k]
    (a, b), (c, d) = case.re, (-case.im[1] if case.im[0] == 0.0 else case.im[0], case.im[1])
    if rng.random() < 0.5 and z.imag + away > c:
        return (a, b), (c, z.imag + away)
    return ((z.real + away, b) if rng.random() < 0.5 and z.real + away < b else (a, b)), (c, d)


def examine(case, ask_package):
    """Verdict per question: 'equal', 'refused …', 'wrong: …' or 'unknown' if undecided."""
    h = dtm.QuasiPolynomial(case.coefficients, case.delays)
    counter = BallCounter(case.coefficients, case.delays, max_pieces=40_000)
    verdicts, places = {}, {}

    def judge(question, given, wanted):
        if isinstance(given, Exception):
            verdicts[question] = refusal(counter, given)
            place = getattr(given, "place", None)
            lost = "" if place is None else f", condition {counter.condition(place):.1e}"
            places[question] = f"{given if place is None else place}{lost}"
        elif given == wanted:
            verdicts[question] = "equal"
        else:
            verdicts[question] = f"wrong: {given}, not {wanted}"

    def fresh(ask):
        counter.pieces = 0
        try:
            return ask()
        except OnContourError:
            return "on the contour"
        except (TooManyPiecesError, ValueError):
            return "unknown"

    wanted = fresh(lambda: region_count(counter, case))
    given = ask_package(lambda: h.count(re=case.re, im=case.im))
    counter.pieces = 0
    if isinstance(wanted, str) and not isinstance(given, Exception):
        verdicts["count"] = wanted
    else:
        judge("count", given, wanted)
    if not isinstance(wanted, str) and wanted <= 300:
        found = ask_package(lambda: h.roots(re=case.re, im=case.im))
        counter.pieces = 0
        if isinstance(found, Exception):
            judge("sum of roots", found, wanted)
        else:
            judge("sum of roots", int(found.multiplicities.sum()), wanted)
            if found.counted != found.multiplicities.sum():
                verdicts["sum of roots"] = f"wrong: counted {found.counted}, not {wanted}"
            elif found.counted != wanted and case.im[0] == 0.0:
                # All roots of a disc that meets the axis are counted, as documented.
                below = found.multiplicities[abs(found.roots.imag) <= found.radii] - 1
                if 0 < found.counted - wanted <= below.sum():
                    verdicts["sum of roots"] = "cluster on the axis"
            counter.max_pieces = 10**6
            fault = fresh(lambda: discs_right(counter, found))
            verdicts["discs"] = (
                "equal" if fault is None else fault if fault == "unknown" else f"wrong: {fault}"
            )
            counter.max_pieces = 40_000
            if len(found):
                re, im = beside_a_root(case, found)
                wanted = fresh(lambda: counter.rectangle(re, im))
                given = ask_package(lambda: h.count(re=re, im=im))
                counter.pieces = 0
                if not isinstance(wanted, str):
                    judge("beside a root", given, wanted)
    if case.line is not None:
        wanted = fresh(lambda: counter.right_of(case.line))
        if not isinstance(wanted, str):
            given = ask_package(lambda: h.count(re=(case.line, None)))
            counter.pieces = 0
            judge("half plane", given, wanted)
    if h.kind in ("polynomial", "retarded", "neutral"):
        first = ask_package(h.rightmost)
        if isinstance(first, Exception):
            counter.pieces = 0
            judge("rightmost", first, 0)
        elif len(first):
            # Roots with equal real parts are ordered by centres: take the rightmost disc.
            z, r = max(
                zip(first.roots.tolist(), first.radii.tolist(), strict=True),
                key=lambda disc: disc[0].real + disc[1],
            )

            def beyond():
                with precision(EXACT_BITS):
                    # Beyond the disc by 1e-24 of the modulus, because the root may be on its edge.
                    edge = arb(z.real) + arb(r) + arb(1e-24) * arb(abs(z) or 1.0)
                return counter.right_of(edge)

            wanted = fresh(beyond)
            verdicts["rightmost"] = "equal" if wanted == 0 else f"wrong: {wanted} beyond"
            if isinstance(wanted, str):
                verdicts["rightmost"] = wanted
            if verdicts["rightmost"] == "equal":
                held = fresh(lambda: discs_right(counter, first))
                if held is not None:
                    verdicts["rightmost"] = held if held == "unknown" else f"wrong: {held}"
        elif h.kind == "retarded":
            # There are infinitely many roots, and one of them is rightmost.
            verdicts["rightmost"] = "refused: empty"
            places["rightmost"] = str(first.region[0])
        else:
            verdicts["rightmost"] = "none"
    return verdicts, places


class TooSlowError(Exception):
    """The case took longer than its limit."""


def ring(signum, frame):
    raise TooSlowError


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--start", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="one case, in full")
    parser.add_argument("--limit", type=float, default=20.0, help="seconds a case may take")
    options = parser.parse_args()
    signal.signal(signal.SIGALRM, ring)
    tally, kinds, slow = Counter(), Counter(), 0
    numbers = range(options.start, options.start + options.cases)
    if options.only is not None:
        numbers = [options.only]
    begin = time.perf_counter()
    for number in numbers:
        case = hard_function(options.seed, number)
        if options.only is not None:
            print(case)
        package = Package()
        start = time.perf_counter()
        signal.setitimer(signal.ITIMER_REAL, options.limit)
        try:
            verdicts, places = examine(case, package)
        except TooSlowError:
            verdicts, places = {"count": "slow"}, {}
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        spent = time.perf_counter() - start
        if package.seconds > 1.0:
            slow += 1
            balls = spent - package.seconds
            print(f"{number} {case.kind}: {package.seconds:.1f} s, balls {balls:.1f} s", flush=True)
        kinds[case.kind] += 1
        for question, verdict in verdicts.items():
            tally[question, verdict.split(":")[0]] += 1
            if verdict.startswith(("wrong", "refused", "slow")) and verdict != "refused near":
                place = places.get(question, "")
                print(f"{number} {case.kind}: {question} {verdict} {str(place)[:120]}", flush=True)
    spent = time.perf_counter() - begin
    print(f"{sum(kinds.values())} cases, seed {options.seed}, {spent:.0f} s, {slow} above 1 s")
    print(dict(kinds))
    outcomes = sorted({verdict for _, verdict in tally})
    print(f"{'':14s}" + "".join(f"{name:>20s}" for name in outcomes))
    for question in QUESTIONS:
        print(f"{question:14s}" + "".join(f"{tally[question, name]:20d}" for name in outcomes))


if __name__ == "__main__":
    main()
