"""The conditions under which recordings are made, and what an estimator must achieve under each."""

from __future__ import annotations

from dataclasses import dataclass

#: Sample time of the controller, s, and the bound of its command, m/s.
SAMPLE = 0.065
LIMIT = 1.0

#: What is demanded of verdicts: most results are reliable; or most are refused or not reliable
#: instead, where the log does not hold what an estimate needs; or nothing.
ANSWER, MAY_REFUSE, NOTHING = "answer", "may refuse", "nothing"


@dataclass(frozen=True)
class Condition:
    """What is wrong with a recording. Units are m and s."""

    name: str
    demand: str = ANSWER
    error: float = 1.15  #: Largest root-mean-square error of the delay, in bounds.
    # The vehicle.
    lag: bool = False
    second_lag: float = 0.0
    delay_wander: float = 0.0  #: Standard deviation; the correlation time is 1 s.
    delay_ramp: float = 0.0  #: Change of the delay over the record.
    commands_lost: float = 0.0  #: Share of the commands that are logged and never arrive.
    # The air, as a velocity that is added to the command at the input of the plant.
    air: float = 0.0  #: Random walk of the velocity, m/s per root of a second.
    gust: tuple[float, float] | None = None  #: Standard deviation and correlation time.
    trim: float = 0.0
    # The sensor.
    white: float = 0.005
    correlation: float = 0.0  #: Of a first-order noise from row to row, as large as CORRELATED.
    quantum: float = 0.0
    outliers: float = 0.0  #: Share of the rows.
    # The log.
    rows: int = 120
    rest: tuple[int, int] = (8, 20)  #: Rows before the step.
    rows_lost: float = 0.0
    hole: float = 0.0  #: Duration of a hole in the rise.
    every: int = 1  #: One row in so many is logged.
    clock: float = 1.0  #: Speed of the log's clock, in that of the vehicle's.
    sampling_jitter: float = 0.0  #: The rows are sampled up to so much early or late.
    nominal_stamps: bool = False
    stamp_jitter: float = 0.0
    command_logged: bool = True
    # The estimate.
    sample_time_told: bool = True
    free: tuple[str, ...] = ("delay", "gain")


#: Standard deviation of the correlated noise of a sensor.
CORRELATED = 0.005

WITH_LAG = ("delay", "gain", "lag")

CONDITIONS = [
    Condition("white", error=1.05),
    Condition("rows lost 5 %", rows_lost=0.05),
    Condition("rows lost 20 %", rows_lost=0.20),
    Condition("hole of 1 s", hole=1.0),
    Condition("half rate", every=2),
    Condition("clock off 1 %", MAY_REFUSE, clock=1.01),
    Condition("commands lost 5 %", MAY_REFUSE, commands_lost=0.05),
    Condition("delay wanders 30 ms", MAY_REFUSE, delay_wander=0.03),
    Condition("delay ramps 100 ms", MAY_REFUSE, delay_ramp=0.1),
    Condition("jitter 20 ms nominal", MAY_REFUSE, sampling_jitter=0.02, nominal_stamps=True),
    Condition("jitter 20 ms logged", sampling_jitter=0.02),
    Condition("stamps jitter 10 ms", NOTHING, stamp_jitter=0.01),
    Condition("sample time not told", sample_time_told=False),
    Condition("air 0.002", air=0.002),
    Condition("air 0.02", air=0.02),
    Condition("air 0.05", air=0.05),
    Condition("gust 0.05 1 s", gust=(0.05, 1.0)),
    Condition("gust 0.1 0.3 s", gust=(0.1, 0.3)),
    Condition("trim -0.02", trim=-0.02),
    Condition("trim -0.05", trim=-0.05),
    Condition("sensor AR 0.6", correlation=0.6, white=0.002),
    Condition("sensor AR 0.9", correlation=0.9, white=0.002),
    Condition("second lag 30 ms", MAY_REFUSE, lag=True, second_lag=0.03, free=WITH_LAG),
    Condition("second lag 60 ms", MAY_REFUSE, lag=True, second_lag=0.06, free=WITH_LAG),
    Condition("lag left out 1 mm", MAY_REFUSE, lag=True, white=0.001),
    Condition("lag left out 5 mm", MAY_REFUSE, lag=True),
    Condition("lag left out air 0.02", MAY_REFUSE, lag=True, air=0.02),
    Condition("quantised 1 cm", quantum=0.01, white=0.001),
    Condition("outliers 3 %", outliers=0.03),
    Condition("short", rows=40, rest=(8, 8)),
    Condition("lag free white", lag=True, free=WITH_LAG),
    Condition("lag free air 0.02", lag=True, air=0.02, free=WITH_LAG),
    Condition("lag free gust 0.05 1 s", lag=True, gust=(0.05, 1.0), free=WITH_LAG),
    Condition("lag free gust 0.1 0.3 s", lag=True, gust=(0.1, 0.3), free=WITH_LAG),
    Condition("no command white", command_logged=False),
    Condition("no command air 0.02", air=0.02, command_logged=False),
    Condition("no command gust 0.05 1 s", gust=(0.05, 1.0), command_logged=False),
]
