"""Delay estimation on plants and faults that the estimator does not know.

`plants` draws the plants and their experiments, `faults` what is wrong with them, and `simulate`
steps many runs at once. `linear` is what a loop feels of a linear plant, `least_squares` fits such
a plant to a response, and `truth` has the range in which an answer is right. `sizes` finds how
large a fault must be to do harm, `rows` lists what is measured and `demands` what is demanded.
`estimates` asks `deadtime`, and so do `gains` and `margins`, which try what `tune` and `design`
make of such records on the true plants; nothing else here uses it. `table` prints.
"""
