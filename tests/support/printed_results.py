"""Examples that print their results, in docstrings and on pages."""

import doctest


def failures(examples: doctest.DocTest) -> str:
    """What the examples printed that differs from what they show; empty if nothing does."""
    report: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    runner.run(examples, out=report.append)
    return "".join(report)
