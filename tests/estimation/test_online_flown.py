"""The delay of a flight of ArduPilot's Copter, from its own log and from the link."""

import sys
from pathlib import Path

import deadtime as dtm
import pytest
from deadtime.estimation import online
from deadtime.experiments import FlightNoise

sys.path.append(str(Path(__file__).resolve().parents[2] / "benches"))

from reality import firmware
from reality.dataflash import recording_of
from reality.flights import Flight

#: Far more than the noise of the firmware: it stands for what limits of rate leave unexplained.
NOISE = FlightNoise(white=0.01, air=0.05, air_time=1.0)


def both(folder, flight):
    """The track from the log of the vehicle, and that from the rows of the link."""
    facts = firmware.facts_of(folder, flight)
    own = recording_of(folder / facts["log"], facts["number"], flight.axis)
    names = {name: name for name in ("time", "reference", "output", "command")}
    link = dtm.read_recording(folder / f"{flight.name}.csv", **names)
    loop = dtm.ControlLoop(dtm.Integrator(1.0, lag=0.2), dtm.P(1.0), sample_time=0.065)
    options = {"delays": (0.0, 0.6), "lags": (0.05, 0.6, 8), "noise": NOISE}
    return [online(one, loop, **options) for one in (own, link)]


@pytest.mark.survey
@pytest.mark.flight
@pytest.mark.long
def test_the_log_of_the_vehicle_and_the_link_agree(tmp_path):
    if (reason := firmware.why_not()) is not None:
        pytest.skip(reason)
    flight = Flight("height", "calm", 0.0, 1)
    firmware.fly(tmp_path, [flight])
    own, link = (track.last for track in both(tmp_path, flight))
    # The limits of the vehicle are not in the plant: what finds changes has to doubt itself.
    if not (own.known and link.known):
        assert own.verdict != "reliable" or link.verdict != "reliable"
        return
    # Each holds the mean of the other.
    for one, other in ((own, link), (link, own)):
        low, high = one.delay_plus_lag_ci
        assert low < other.delay_plus_lag < high
