"""Delay estimation on simulated roll-rate loops of multirotors, beside the field's own tools.

`generator` makes the logs, `bound` computes their Cramér-Rao bound, `field_tools` has the methods
of log viewers and of driver assistance, and `table` estimates and prints. Only `table` uses
`deadtime`.
"""
