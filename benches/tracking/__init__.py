"""Long runs of a loop whose delay changes, and what estimators make of them row by row.

`runs` makes them without `deadtime`, `bound` has the least variance that any estimator can have,
`lagd` the scheme of openpilot's estimator, `scores` what each of them achieves.
"""
