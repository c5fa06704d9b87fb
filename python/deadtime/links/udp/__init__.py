"""A control loop over UDP: plant, controller, and a relay that emulates the network.

The integrator of section 2.1 of Armah & Yi on one computer, its controller on another. Every packet
carries a number, its time, and the number and time of the one it answers, so that the round trip
is measured during the run. All parts run in the current event loop, in real or virtual time;
``python -m deadtime.links.udp`` runs each as a process of its own.
"""

from deadtime.links.udp.controller import Controller, ControllerOptions, ControllerReport
from deadtime.links.udp.delays import Constant, Delays, LogNormal, Normal, ShiftedGamma
from deadtime.links.udp.described import DELAYS, POLICIES, network_of, policy_of
from deadtime.links.udp.integrator import HeldIntegrator
from deadtime.links.udp.network import Bursts, Network, Path
from deadtime.links.udp.packets import LoopPacket, decode_doubles, encode_doubles
from deadtime.links.udp.plant import Plant, run_plant
from deadtime.links.udp.plant_options import PlantOptions, PlantReport
from deadtime.links.udp.policies import DropLate, HoldThenZero, JitterBuffer, NewestWins, Policy
from deadtime.links.udp.processes import run_processes
from deadtime.links.udp.relay import Relay, RelayOptions
from deadtime.links.udp.statistics import ClockOffset, LinkReport, LinkStatistics, Percentiles
from deadtime.links.udp.trial import ENDS, Trial, TrialReport, run_trial
from deadtime.links.udp.wires import Doubles, Stamped, Wire

__all__ = [
    "DELAYS",
    "ENDS",
    "POLICIES",
    "Bursts",
    "ClockOffset",
    "Constant",
    "Controller",
    "ControllerOptions",
    "ControllerReport",
    "Delays",
    "Doubles",
    "DropLate",
    "HeldIntegrator",
    "HoldThenZero",
    "JitterBuffer",
    "LinkReport",
    "LinkStatistics",
    "LogNormal",
    "LoopPacket",
    "Network",
    "NewestWins",
    "Normal",
    "Path",
    "Percentiles",
    "Plant",
    "PlantOptions",
    "PlantReport",
    "Policy",
    "Relay",
    "RelayOptions",
    "ShiftedGamma",
    "Stamped",
    "Trial",
    "TrialReport",
    "Wire",
    "decode_doubles",
    "encode_doubles",
    "network_of",
    "policy_of",
    "run_plant",
    "run_processes",
    "run_trial",
]
