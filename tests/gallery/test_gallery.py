"""Every problem of the gallery, solved by the package and compared with its known answers."""

import math
import pickle

import numpy as np
import pytest
from deadtime.gallery import _access as gallery

KEYS = gallery.names()

# A region whose edge on the real axis meets a cluster or a double root: count both halves.
CLUSTER_ON_THE_AXIS = {"mazanti2021", "boussaada2016"}


def test_keys_are_in_order_and_looked_up():
    assert list(KEYS) == sorted(KEYS)
    assert [p.key for p in gallery.problems()] == list(KEYS)
    with pytest.raises(KeyError, match=r"appeltans2023-2\.12"):
        gallery.problem("appeltans2023")
    assert pickle.loads(pickle.dumps(gallery.problem("yi2007"))) is gallery.problem("yi2007")


@pytest.mark.parametrize("key", KEYS)
def test_the_entry_is_whole(key):
    problem = gallery.problem(key)
    assert len(problem.title) > 8
    assert len(problem.reference) > 40
    assert key.split("-")[0][-4:] in problem.reference.replace("\n", " ")
    delays = problem.h.delays
    assert np.allclose(delays / problem.base_delay, np.round(delays / problem.base_delay))
    if problem.family is not None:
        assert problem.family.at(**problem.values) == problem.h
        assert set(problem.family.names) == set(problem.values)
    with pytest.raises(TypeError):
        problem.values["x"] = 1.0


@pytest.mark.parametrize("key", KEYS)
def test_as_many_roots_as_certified(key):
    problem = gallery.problem(key)
    re, (low, high) = problem.region
    if key not in CLUSTER_ON_THE_AXIS:
        assert problem.h.count(re=re, im=(low, high)) == problem.count
    # Roots on the real axis count once, the others twice in the mirrored region.
    found = problem.h.roots(re=re, im=(-high, high))
    assert found.counted == problem.h.count(re=re, im=(-high, high))
    upper = found.multiplicities[found.roots.imag >= 0].sum()
    assert upper >= problem.count
    assert key in CLUSTER_ON_THE_AXIS or upper == problem.count


@pytest.mark.parametrize("key", KEYS)
def test_the_rightmost_root_is_the_certified_one(key):
    problem = gallery.problem(key)
    found = problem.h.rightmost()
    if problem.rightmost is None:
        assert len(found) == 0
        assert problem.h.spectral_abscissa() == problem.h.chain_abscissa()
        return
    # The last bit of the centre's own where the radius is smaller still.
    assert abs(found[0] - problem.rightmost) <= found.radii[0] + 2.3e-16 * max(1, abs(found[0]))
    assert problem.h.spectral_abscissa() == max(found[0].real, problem.h.chain_abscissa())
    if key != "mazanti2021":
        assert found.multiplicities[0] == problem.multiplicity


def test_published_answers():
    def abscissa(key, **changes):
        problem = gallery.problem(key)
        h = problem.family.at(**{**problem.values, **changes}) if changes else problem.h
        return h.spectral_abscissa()

    assert f"{abscissa('appeltans2023-2.9'):.4f}" == "-0.2845"
    for gain in (0.99, 1.01):
        assert (abscissa("wright1955", a=gain * math.pi / 2) < 0) == (gain < 1)
        assert (abscissa("armah2017", Kp=gain * math.pi / 2 / 0.36) < 0) == (gain < 1)
        critical = math.acos(-0.25) / math.sqrt(15)
        assert (abscissa("mackey1977", tau=gain * critical) < 0) == (gain < 1)
    for key, log in (("armah2017-pv", math.log(0.3) / 0.36), ("olgac1994", math.log(0.6) / 0.8)):
        assert gallery.problem(key).h.chain_abscissa() == pytest.approx(log, rel=1e-14)
    perturbed = gallery.problem("appeltans2023-2.6")
    assert perturbed.h.is_stable(strong=False)
    assert not perturbed.h.is_stable()
    assert not perturbed.family.at(T=2.05).is_stable(strong=False)
    assert gallery.problem("boussaada2016").h.rightmost().multiplicities.tolist() == [2]
    sixfold = gallery.problem("mazanti2021").h.rightmost()
    # Sixfold on paper: coefficients rounded to doubles spread the six by (1e-16)^(1/6), roughly.
    sixfold = gallery.problem("mazanti2021").h.roots(re=(-6.1, -5.9), im=(-0.1, 0.1))
    assert sixfold.multiplicities.tolist() == [1] * 6
    assert (np.abs(sixfold.roots + 6.021) < 0.04).all()
    assert abs(sixfold.roots.mean() + 6.021) < 1e-3
