"""Delay estimation on recordings with the disturbances, faults and clocks of real flights.

`conditions` lists what is measured, `generator` makes the recordings, `bound` computes their
Cramér-Rao bound, and `table` estimates and prints; `designs` does so for gains from estimates.
`firmware` flies ArduPilot's Copter (`flights`) and estimates. The generator and the bound do not
use `deadtime`.
"""
