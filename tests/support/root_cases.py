"""Equations whose roots are certified, from a table."""

import json
from pathlib import Path

from deadtime import QuasiPolynomial

CASES = {
    case["name"]: case
    for case in json.loads(
        (Path(__file__).parents[1] / "reference" / "root_cases.json").read_text(encoding="utf-8")
    )["cases"]
}

# Cases with a root exactly on an edge.
ROOT_ON_AN_EDGE = {"on_contour"}

# Cases without a rightmost root: chains lie as far right or further.
CHAINS_LEAD = {"tdscontrol_2.6_tau2=2", "tdscontrol_2.6_tau2=2.05", "diff_26"}

# Cases whose reference is the rightmost root of the region only.
REGION_ONLY = {"high_freq"}

# Tolerance for the last bit of the centre where a radius is that small.
ULP = 2.3e-16


def make(case):
    return QuasiPolynomial(case["coefs"], case["delays"])


def region(case):
    a, b, c, d = case["region"]
    return {"re": (a, b), "im": (c, d)}


def symmetric(case):
    a, b, c, d = case["region"]
    return {"re": (a, b), "im": (-d, d) if c == 0 else (c, d)}
