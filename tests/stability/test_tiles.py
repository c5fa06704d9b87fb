"""Maps in tiles: the whole map, in any process."""

import pickle

import deadtime as dtm
import numpy as np
import pytest
from deadtime.stability import tiles

Kp, Kv = dtm.parameters("Kp Kv")
FAMILY = dtm.s + (Kp + Kv * dtm.s) * dtm.delay(0.36)
LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.1), delay=0.36, sample_time=0.065)
RANGES = {"Kp": (0.1, 6.0), "Kv": (-0.9, 0.9)}


@pytest.mark.parametrize("family", [FAMILY, LOOP])
def test_tiles_are_the_whole_map(family):
    whole = dtm.stability_map(family, RANGES, (70, 50))
    grid = tiles(family, RANGES, (70, 50), (32, 20))
    assert grid.shape == (3, 3)
    assert len(list(grid)) == 9
    covered = np.zeros((70, 50), dtype=int)
    for tile in grid:
        part = tile.map()
        np.testing.assert_array_equal(part.unstable, whole.unstable[tile.place])
        np.testing.assert_allclose(part.abscissa, whole.abscissa[tile.place], rtol=1e-9)
        covered[tile.place] += 1
    assert (covered == 1).all()


def test_other_parameters_and_points_of_ones_own():
    gains = np.array([0.5, 1.0, 4.0, 9.0])
    grid = tiles(LOOP, {"Kp": gains, "Kv": (-0.2, 0.2)}, (9, 5), (3, 5), at={"delay": 0.1})
    assert grid.chunks == ((3, 1), (5,))
    whole = dtm.stability_map(LOOP, {"Kp": gains, "Kv": (-0.2, 0.2, 5)}, at={"delay": 0.1})
    np.testing.assert_array_equal(grid[1, 0].map().unstable, whole.unstable[3:])


@pytest.mark.parametrize("family", [FAMILY, LOOP])
def test_what_reaches_another_process_is_the_same(family):
    grid = pickle.loads(pickle.dumps(tiles(family, RANGES, (30, 20), (20, 20))))
    chart = grid[1, 0].map(abscissa=False)
    again = pickle.loads(pickle.dumps(chart))
    np.testing.assert_array_equal(again.unstable, chart.unstable)
    assert [len(curve) for curve in again.boundaries] == [len(curve) for curve in chart.boundaries]


def test_results_of_studies_can_be_pickled():
    loop = LOOP.replace(Kv=0.0)
    results = [
        dtm.sweep(loop, {"Kp": np.array([0.5, 1.0])}),
        dtm.design(loop, controller=dtm.P, objective="abscissa"),
        dtm.identifiability(loop, dtm.Experiment.step(), noise=0.005),
    ]
    for result in results:
        assert repr(pickle.loads(pickle.dumps(result))) == repr(result)


@pytest.mark.parametrize("scheduler", ["threads", "distributed"])
def test_dask_computes_them(scheduler):
    da = pytest.importorskip("dask.array")
    distributed = pytest.importorskip("distributed")
    grid = tiles(LOOP, RANGES, (60, 40), (30, 20))

    def counts_of(block_id):
        return grid[block_id].map(abscissa=False, threads=1).unstable

    counts = da.map_blocks(counts_of, chunks=grid.chunks, dtype=np.int32)
    if scheduler == "threads":
        found = counts.compute(scheduler="threads", num_workers=2)
    else:
        with (
            distributed.LocalCluster(
                n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
            ) as cluster,
            distributed.Client(cluster),
        ):
            found = counts.compute()
    whole = dtm.stability_map(LOOP, RANGES, (60, 40), abscissa=False)
    np.testing.assert_array_equal(found, whole.unstable)


def test_tiles_that_make_no_sense_are_refused():
    with pytest.raises(ValueError, match="a map has two"):
        tiles(FAMILY, {"Kp": (0.0, 1.0)}, (3, 3))
    with pytest.raises(ValueError, match=r"tile=\(0, 3\)"):
        tiles(FAMILY, RANGES, (3, 3), (0, 3))
    with pytest.raises(TypeError, match="two whole numbers"):
        tiles(FAMILY, RANGES, (3.5, 3))
    with pytest.raises(IndexError, match="the map has 1 by 1"):
        tiles(FAMILY, RANGES, (3, 3))[1, 0]
