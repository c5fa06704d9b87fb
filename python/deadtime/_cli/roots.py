"""``deadtime roots``: characteristic roots of a loop."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np

from deadtime._base.bounds import Bounds
from deadtime._base.drawing import new_figure
from deadtime._cli import options as opt
from deadtime._cli.fills import Fills, Given, filled
from deadtime._cli.show import print_json, print_table, print_text, results_table, save_figure
from deadtime._cli.verdicts import listed, verdict
from deadtime.roots import plot_certificate, plot_root_set

HEADS = ("Re s / (1/s)", "Im s / (rad/s)", "multiplicity", "disc radius")


@filled
def command(
    *,
    kp: opt.Kp,
    delay: opt.Delay = None,
    kv: opt.Kv = 0.0,
    numbers: Annotated[Given, Fills(opt.described_loop, "plant gain lag sample_time")],
    filter: opt.Filter = None,  # noqa: A002
    re: opt.Ends | None = None,
    im: opt.Ends | None = None,
    rightmost: Annotated[int, Bounds(1)] = 3,
    plot: opt.Plot = None,
    certificate: Path | None = None,
    as_json: opt.As_json = False,
) -> None:
    """Find the characteristic roots of a loop: the rightmost ones, or all in a region.

    Parameters
    ----------
    re
        Range of the real parts of a region, 1/s.
    im
        Range of the imaginary parts of a region, rad/s.
    rightmost
        Number of rightmost roots with Im s >= 0, if no region is given.
    certificate
        Write the proof of the number of roots to this file, as JSON. With --plot, the proof is
        drawn too.
    """
    delay = opt.delay_beside(numbers["plant"], delay)
    loop = opt.described_loop(kp, kv, delay, corner=filter, **numbers)
    if (re is None) != (im is None):
        raise ValueError("a region needs both --re and --im: give both, or leave both out")
    found = loop.rightmost(rightmost) if re is None else loop.poles(re, im)
    chain = -np.inf if loop.is_sampled else loop.characteristic().chain_abscissa()
    proof = None
    if certificate is not None:
        # Of a sampled loop there is no contour: `characteristic` says so.
        reals, heights = found.region
        proof = loop.certify(reals, heights)
        certificate.write_text(proof.to_json(indent=1), encoding="utf-8")
    if plot is not None:
        figure, axes = new_figure(6.0, 4.5)
        if proof is not None:
            plot_certificate(axes, proof)
        chains = () if loop.is_sampled else loop.characteristic().chains()
        plot_root_set(axes, found, chains)
        save_figure(figure, plot)
    if as_json:
        print_json(
            "roots",
            {
                "roots": [complex(root) for root in found.roots],
                "multiplicities": found.multiplicities,
                "radii": found.radii,
                "counted": found.counted,
                "region": {"re": found.region[0], "im": found.region[1]},
                "chain_abscissa": chain,
                "spectral_abscissa": loop.spectral_abscissa(),
                "stable": loop.is_stable(),
            },
        )
        return
    rows = [
        (f"{root.real:.10g}", f"{root.imag:.10g}", str(multiplicity), f"{radius:.1e}")
        for root, multiplicity, radius in zip(
            found.roots, found.multiplicities, found.radii, strict=True
        )
    ]
    print_table(results_table(HEADS, rows))
    print_text(listed(found, rightmost if re is None else None, chain))
    if np.isfinite(chain):
        print_text(f"the equation is neutral: a chain of roots approaches Re s = {chain:.6g}")
    print_text(verdict(loop))
