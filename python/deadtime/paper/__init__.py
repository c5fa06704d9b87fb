"""Reproduction of a paper: every printed number beside the computed one, with a verdict.

S. K. Armah and S. Yi, "Analysis of Time Delays in Quadrotor Systems and Design of Control" (2017):
the delay of a loop from the overshoot of its step response by Lambert W, and gains for it. Each
table and figure is a function that computes it with the public models of this package and returns
data; `reproduce` runs them all, and ``deadtime reproduce`` prints them and writes a page.

Import it with ``from deadtime import paper``.
"""

from deadtime.loops import PAPER_FILTER
from deadtime.paper._page import HEADS as HEADS, write_reproduction as write_reproduction
from deadtime.paper.comparison import Comparison, Verdict, agreeing_digits, printed_digits
from deadtime.paper.figure2 import Figure2, Scenario, Trial, figure2
from deadtime.paper.figure3 import Figure3, coarse_limit, figure3
from deadtime.paper.figure10 import Curve, Figure10, figure10, velocity_loop
from deadtime.paper.figure11 import Figure11, SettlingTimes, figure11
from deadtime.paper.figures6and7 import Figure6, Figure7, Flight, figure6, figure7
from deadtime.paper.figures8and9 import Figure8, Figure9, figure8, figure9
from deadtime.paper.gap import Gap, gap
from deadtime.paper.internet_loop import internet_loop
from deadtime.paper.inversion import (
    damping_of,
    delay_by_dominant_root,
    delay_by_simulation,
    overshoot,
)
from deadtime.paper.part import Grid, Part
from deadtime.paper.reproduction import PARTS, TITLES, Reproduction, reproduce
from deadtime.paper.table1 import PRINTED_OVERSHOOTS, Table1, Table1Row, table1
from deadtime.paper.table2 import (
    SAMPLE_TIME,
    Table2,
    Table2Row,
    altitude_loop,
    simulink,
    table2,
)
from deadtime.paper.time_scales import Explanation, Stretch, explain, stretch, time_scale

__all__ = [
    "PAPER_FILTER",
    "PARTS",
    "PRINTED_OVERSHOOTS",
    "SAMPLE_TIME",
    "TITLES",
    "Comparison",
    "Curve",
    "Explanation",
    "Figure2",
    "Figure3",
    "Figure6",
    "Figure7",
    "Figure8",
    "Figure9",
    "Figure10",
    "Figure11",
    "Flight",
    "Gap",
    "Grid",
    "Part",
    "Reproduction",
    "Scenario",
    "SettlingTimes",
    "Stretch",
    "Table1",
    "Table1Row",
    "Table2",
    "Table2Row",
    "Trial",
    "Verdict",
    "agreeing_digits",
    "altitude_loop",
    "coarse_limit",
    "damping_of",
    "delay_by_dominant_root",
    "delay_by_simulation",
    "explain",
    "figure2",
    "figure3",
    "figure6",
    "figure7",
    "figure8",
    "figure9",
    "figure10",
    "figure11",
    "gap",
    "internet_loop",
    "overshoot",
    "printed_digits",
    "reproduce",
    "simulink",
    "stretch",
    "table1",
    "table2",
    "time_scale",
    "velocity_loop",
]
