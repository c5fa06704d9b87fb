"""All roots of a region beside qpmr, tdcpy and cxroots, on every certified reference case.

Each peer runs in a process of its own that is ended after a time limit; ours and theirs take turns.
The answer of a peer is right if it contains every certified root of the upper half plane and no
other: `miss` counts certified roots further than 1e-6 (of their modulus) from any returned root,
`extra` returned roots further than that from any certified one. An m-fold root, or m roots within 1
per cent, need only be accurate to the m-th root of 1e-10, as one number or as several. All get the
upper half of the region. cxroots refuses a contour through a root, so it gets an edge 2 per cent of
the height below the real axis; ours and qpmr accept roots on the real axis. Times are medians after
a first call and include the conversion of the coefficients to the format of the program; ratios are
those of cases that both get right. At the end the roots of a long chain, beside Lambert W, which
gives the same numbers without a proof.

Run ``python benches/peers/roots.py [--quick] [--only CASE …] [--peers PEER …]``.
"""

from __future__ import annotations

import argparse
import json
import logging
import math
import multiprocessing
import time
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import deadtime as dtm
import numpy as np

CASES = Path(__file__).parents[2] / "tests" / "reference" / "root_cases.json"
QUICK = ("armah_K2", "armah_neutral_Kv0.3", "mackey_glass")
NEAR = 1e-6
Region = tuple[float, float, float, float]


def with_qpmr(coefficients: np.ndarray, delays: np.ndarray, region: Region) -> Any:
    import qpmr

    return qpmr.qpmr(coefficients, delays, region=region)[0]


def with_tdcpy(coefficients: np.ndarray, delays: np.ndarray, region: Region) -> Any:
    import tdcpy
    from tdcpy.common.quasipoly import qp_to_ndde

    a, delays_a, h, delays_h = qp_to_ndde(coefficients, delays)
    neutral = h is not None and np.size(h) > 0
    system = tdcpy.NDDE(a, delays_a, h, delays_h) if neutral else tdcpy.RDDE(a, delays_a)
    return tdcpy.roots(system, r=list(region))[0]


def with_cxroots(coefficients: np.ndarray, delays: np.ndarray, region: Region) -> Any:
    import cxroots

    rows = [np.polynomial.Polynomial(row) for row in coefficients]
    slopes = [row.deriv() for row in rows]

    def h(s: Any) -> Any:
        return sum(row(s) * np.exp(-s * tau) for row, tau in zip(rows, delays, strict=True))

    def slope(s: Any) -> Any:
        terms = zip(rows, slopes, delays, strict=True)
        return sum((dp(s) - tau * p(s)) * np.exp(-s * tau) for p, dp, tau in terms)

    low, high = region[2:]
    below = 0.02 * (high - low) if low == 0.0 else 0.0
    rectangle = cxroots.Rectangle(region[:2], (low - below, high))
    return rectangle.roots(h, slope, verbose=False).roots


PEERS: dict[str, Callable[[np.ndarray, np.ndarray, Region], Any]] = {
    "qpmr": with_qpmr,
    "tdcpy": with_tdcpy,
    "cxroots": with_cxroots,
}


def timed(function: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """The result of a call and the median of its times after a first call."""
    seconds: list[float] = []
    while not seconds or (sum(seconds) < 0.05 and len(seconds) < 20):
        start = time.perf_counter()
        result = function(*arguments)
        seconds.append(time.perf_counter() - start)
    return result, float(np.median(seconds))


def serve(name: str, pipe: Connection) -> None:
    """Answer cases until the pipe closes: roots and seconds, or the error."""
    warnings.simplefilter("ignore")
    logging.disable(logging.CRITICAL)
    np.seterr(all="ignore")
    while True:
        try:
            coefficients, delays, region = pipe.recv()
        except EOFError:
            return
        try:
            found, seconds = timed(PEERS[name], coefficients, delays, region)
            pipe.send((np.asarray(found, complex).ravel(), seconds))
        except Exception as error:
            pipe.send((f"{type(error).__name__}", 0.0))


class Peer:
    """A peer in its own process, which is ended if a call takes too long."""

    def __init__(self, name: str, limit: float) -> None:
        self.name, self.limit = name, limit
        self.start()

    def start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=serve, args=(self.name, other), daemon=True)
        self.process.start()
        # The first call imports the package.
        self.pipe.send((np.array([[1.0, 1.0]]), np.array([0.0]), (-2.0, 1.0, -1.0, 1.0)))
        self.pipe.poll(60.0)
        self.pipe.recv()

    def roots(self, case: tuple[np.ndarray, np.ndarray, Region]) -> tuple[Any, float]:
        self.pipe.send(case)
        if self.pipe.poll(self.limit):
            found, seconds = self.pipe.recv()
            return found, seconds
        self.process.kill()
        self.start()
        return "too slow", 0.0


def roots_of(
    coefficients: np.ndarray,
    delays: np.ndarray,
    re: tuple[float, float],
    im: tuple[float, float],
) -> np.ndarray:
    """Our roots, including those on the edge, because peers list them too."""
    return dtm.QuasiPolynomial(coefficients, delays).roots(re=re, im=im, edge="inside").roots


def judge(found: Any, case: dict[str, Any]) -> tuple[int, int]:
    """The number of certified roots that were missed, and of returned ones that are no roots."""
    certified = np.array([complex(re, im) for re, im, _ in case["roots"]])
    a, b, _, d = case["region"]
    near = (found.real >= a - NEAR) & (found.real <= b + NEAR)
    upper = found[near & (found.imag > -NEAR) & (found.imag <= d + NEAR)]
    if not len(certified):
        return 0, len(upper)
    if not len(upper):
        return len(certified), 0
    size = (1.0 + np.abs(certified))[:, None]
    weights = np.array([m for _, _, m in case["roots"]])
    members = np.concatenate([certified, certified[certified.imag > 0].conj()])
    weights = np.concatenate([weights, weights[certified.imag > 0]])
    together = np.abs(certified[:, None] - members[None, :]) <= 1e-2 * size
    room = np.maximum(NEAR, 1e-10 ** (1.0 / (together @ weights)))[:, None]
    met = np.abs(certified[:, None] - upper[None, :]) <= room * size
    return int((~met.any(axis=1)).sum()), int((~met.any(axis=0)).sum())


def long_chain(number: int) -> None:
    """The roots of s + e^-s up to a height, and the same numbers from Lambert W alone."""
    h, high = dtm.s + dtm.delay(1.0), 2 * math.pi * number
    found, seconds = timed(lambda: h.roots(re=(-20, 2), im=(0, high)))
    z, branches = -np.ones(number), np.arange(number)
    _, bare = timed(lambda: dtm.lambertw(z, branches, threads=1))
    print(
        f"chain of {len(found)} roots: {seconds * 1e3:.2f} ms, {seconds / len(found) * 1e6:.3f} us "
        f"a root with its disc; Lambert W, without discs, count or list: "
        f"{bare / number * 1e6:.3f} us, {seconds / bare:.1f} times less"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a moment's run, rough numbers")
    parser.add_argument("--only", nargs="+", metavar="CASE", help="these cases, by name")
    parser.add_argument("--peers", nargs="+", choices=PEERS, default=list(PEERS), metavar="PEER")
    parser.add_argument("--limit", type=float, help="seconds a peer has for a case (20)")
    options = parser.parse_args()
    limit = options.limit or (2.0 if options.quick else 20.0)
    cases = json.loads(CASES.read_text(encoding="utf-8"))["cases"]
    chosen = options.only or (QUICK if options.quick else [case["name"] for case in cases])
    cases = [case for case in cases if case["name"] in chosen]
    peers = []
    for name in options.peers:
        try:
            __import__(name)
        except ImportError:
            print(f"{name} is missing: pip install {name}")
        else:
            peers.append(Peer(name, limit))

    print(f"{'case':22s}{'roots':>6s}{'ours ms':>10s}" + "".join(f"{p.name:>29s}" for p in peers))
    ratios: dict[str, list[float]] = {peer.name: [] for peer in peers}
    right: dict[str, int] = dict.fromkeys(("ours", *ratios), 0)
    for case in cases:
        a, b, c, d = case["region"]
        coefficients, delays = np.array(case["coefs"]), np.array(case["delays"])
        times: dict[str, list[float]] = {name: [] for name in ("ours", *ratios)}
        verdicts: dict[str, str] = {}
        for _ in range(3 if options.quick else 5):
            try:
                own, seconds = timed(roots_of, coefficients, delays, (a, b), (c, d))
                times["ours"].append(seconds)
                missed, extra = judge(np.asarray(own), case)
                verdicts["ours"] = "ok" if not missed + extra else f"miss {missed} extra {extra}"
            except (dtm.DeadtimeError, ValueError) as error:
                verdicts["ours"] = type(error).__name__
            for peer in peers:
                if verdicts.get(peer.name, "") == "too slow" or sum(times[peer.name]) > 2.0:
                    continue
                found, seconds = peer.roots((coefficients, delays, (a, b, c, d)))
                if isinstance(found, str):
                    verdicts[peer.name] = found
                    continue
                missed, extra = judge(found, case)
                verdicts[peer.name] = "ok" if not missed + extra else f"miss {missed} extra {extra}"
                times[peer.name].append(seconds)
        median = float(np.median(times["ours"] or [math.nan]))
        right["ours"] += verdicts["ours"] == "ok"
        line = f"{case['name']:22s}{len(case['roots']):6d}{median * 1e3:10.3f}"
        line += "" if verdicts["ours"] == "ok" else f" ({verdicts['ours']})"
        for peer in peers:
            spent = times[peer.name]
            took = f"{np.median(spent) * 1e3:.1f} ms " if spent else ""
            line += f"{took + verdicts[peer.name]:>29s}"
            if verdicts[peer.name] == "ok":
                right[peer.name] += 1
                if verdicts["ours"] == "ok":
                    ratios[peer.name].append(float(np.median(spent)) / median)
        print(line, flush=True)
    if not options.only:
        long_chain(10_000 if options.quick else 100_000)
    print(f"right: ours {right['ours']} of {len(cases)}")
    for name, values in ratios.items():
        ratio = ""
        if values:
            low, half, high = np.percentile(values, [0, 50, 100])
            ratio = f", where right {half:.0f} x our time (median; {low:.1f} to {high:.0f})"
        print(f"right: {name} {right[name]} of {len(cases)}{ratio}")


if __name__ == "__main__":
    main()
