"""Surveys of the family of plants: `DEADTIME_CASES=500 pytest -m survey -s` prints the figures.

`DEADTIME_FIRST` is the first seed.
"""

import family_survey as survey
import made_records as made
import numpy as np
import pytest

pytestmark = pytest.mark.survey

#: Fewest records of which shares are demanded: of fewer, chance decides.
MANY = 200

#: The numbers of the slow plant.
SLOW = {"delay": 0.3, "gain": 1.0, "lag": 5.0}


@pytest.mark.parametrize("kind", [made.bump_test, made.process_loop, made.height_steps])
def test_kinds_are_found_and_intervals_hold(kind):
    found = survey.surveyed(kind)
    print(found.report(kind.__name__))
    if found.cases < MANY:
        assert found.reliable > 0
        return
    assert found.wrong <= 0.04 * found.cases
    assert found.reliable >= 0.85 * found.cases
    assert (np.mean(found.hits, axis=0) >= 0.93).all()
    assert (np.median(found.ratios, axis=0) <= 1.6).all()


@pytest.mark.parametrize("whole", [False, True])
def test_windows_of_a_run_hold_each_number(whole):
    """Rows cut out of a run, and the same window of the whole run."""
    hits, widths, errors, cases = [], [], [], survey.CASES
    for seed in survey.SEEDS:
        cut = made.slow_window(seed)
        record = made.slow_run(seed) if whole else cut
        rows = (record.time, record.command, record.output)
        found = survey.fit_rows(*rows, earlier=record.time.size - cut.time.size)
        errors.append(survey.least_squares_errors(cut))
        if found.verdict != "reliable":
            continue
        ends = [found.hull.get(name, (np.inf, np.inf)) for name in SLOW]
        hits.append([survey.holds(one, SLOW[name]) for one, name in zip(ends, SLOW, strict=True)])
        widths.append([0.5 * survey.width(one) for one in ends])
    width = np.nanmedian(widths, axis=0) / (1.96 * np.median(errors, axis=0))
    print(
        f"slow windows, whole run {whole}: reliable {len(hits)} of {cases}, delay, gain and lag "
        f"held {np.round(np.mean(hits, axis=0), 3).tolist()}, half width over least squares "
        f"{np.round(width, 2).tolist()}, whose errors are {np.median(errors, axis=0)}"
    )
    if cases < MANY:
        assert hits
        return
    assert len(hits) >= 0.9 * cases
    assert (np.mean(hits, axis=0) >= 464 / 500).all()
    # Least squares knows the class, and that no command means no output.
    assert (width <= 1.3).all()


@pytest.mark.parametrize("plant", [None, "lag"])
def test_lone_sines_are_never_reliable(plant):
    found = [survey.fit(made.lone_sine(seed), plant=plant) for seed in survey.SEEDS]
    assert not [one for one in found if one.verdict == "reliable"]
