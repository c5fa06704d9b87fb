"""Problems of the literature by citation key, with their known answers.

Published systems as quasi-polynomials, for tests of algorithms, comparisons of programs, and study.

Examples
--------
>>> from deadtime import gallery
>>> gallery.names()[:3]
('appeltans2023-2.12', 'appeltans2023-2.6', 'appeltans2023-2.9')
>>> problem = gallery.problem("wright1955")
>>> problem.h
s + 1.57079632679 exp(-1 s)
>>> problem.rightmost
1.5707963267948966j
>>> sorted(p.key for p in gallery.problems() if p.h.kind == "neutral")[0]
'appeltans2023-2.12'
"""

from deadtime.gallery._access import Problem, names, problem, problems

__all__ = ["Problem", "names", "problem", "problems"]
