"""Maps too large for one call, in tiles that an engine such as dask computes one by one."""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, SupportsFloat

from deadtime._base.arrays import Array
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.validation import Points, numbers_at
from deadtime.roots import HasFamily
from deadtime.stability._arguments import map_axes, two_sizes
from deadtime.stability._map import StabilityMap, stability_map


@dataclass(frozen=True, eq=False)
class Tile(ReadOnlyArrays):
    """A part of a large map; made by `tiles`.

    Attributes
    ----------
    family : object
        What is judged.
    axes : dict of str to ndarray
        The points of the two parameters in this part.
    at : dict of str to float
        Values of the other parameters.
    place : tuple of slice
        Where the part is in the whole map.
    """

    family: HasFamily
    axes: dict[str, Array]
    at: dict[str, float]
    place: tuple[slice, slice]

    def map(self, **options: Any) -> StabilityMap:
        """Compute the map of this part.

        Parameters
        ----------
        **options
            Of `stability_map`, such as ``abscissa=False`` and ``threads=1``.

        Returns
        -------
        StabilityMap
            Its cells equal those of the whole map.
        """
        return stability_map(self.family, self.axes, at=self.at, **options)


@dataclass(frozen=True, eq=False)
class Tiles(ReadOnlyArrays):
    """The tiles of a large map; made by `tiles`. Picklable, if what it judges is.

    Attributes
    ----------
    family : object
        What is judged.
    axes : dict of str to ndarray
        All points of the two parameters.
    at : dict of str to float
        Values of the other parameters.
    chunks : tuple of tuple of int
        Number of points of each tile along the first and the second axis, as dask counts them.
    """

    family: HasFamily
    axes: dict[str, Array]
    at: dict[str, float]
    chunks: tuple[tuple[int, ...], tuple[int, ...]]

    @property
    def shape(self) -> tuple[int, int]:
        """Number of tiles along both axes."""
        first, second = self.chunks
        return len(first), len(second)

    def __iter__(self) -> Iterator[Tile]:
        first, second = self.shape
        return (self[place] for place in itertools.product(range(first), range(second)))

    def __getitem__(self, block: tuple[int, int]) -> Tile:
        slices = []
        for number, sizes in zip(block, self.chunks, strict=True):
            place = operator.index(number)
            if not 0 <= place < len(sizes):
                raise IndexError(
                    f"tile {tuple(block)} does not exist: the map has {self.shape[0]} by "
                    f"{self.shape[1]} tiles"
                )
            start = sum(sizes[:place])
            slices.append(slice(start, start + sizes[place]))
        first, second = slices
        parts = {
            name: points[part]
            for (name, points), part in zip(self.axes.items(), (first, second), strict=True)
        }
        return Tile(self.family, parts, self.at, (first, second))

    def __repr__(self) -> str:
        cells = math.prod(len(points) for points in self.axes.values())
        first, second = self.shape
        return f"<{first} by {second} tiles of {' and '.join(self.axes)}, {cells} cells>"


def tiles(
    family: HasFamily,
    ranges: Mapping[str, Points],
    shape: tuple[int, int],
    tile: tuple[int, int] = (1000, 1000),
    *,
    at: Mapping[str, SupportsFloat] | None = None,
) -> Tiles:
    """Divide a large map into tiles, each a `stability_map` of its own.

    Nothing is computed here. An engine such as dask computes the tiles on several processors or
    machines, and a format such as zarr holds what does not fit into memory: see
    :doc:`/guide/large-maps`.

    Parameters
    ----------
    family, ranges, shape, at
        As of `stability_map`, but for the number of cells, which has no limit.
    tile : tuple of int
        Points of a tile along both axes; the last tiles may have fewer. Rows along which a gain
        varies cost little more when they are longer: long tiles cost less for each cell.

    Returns
    -------
    Tiles

    Raises
    ------
    ValueError
        If there are not two ranges, or a number of points is not positive.
    TypeError
        If `ranges` is no mapping.

    Examples
    --------
    >>> import deadtime as dtm
    >>> Kp, Kv = dtm.parameters("Kp Kv")
    >>> h = dtm.s + (Kp + Kv * dtm.s) * dtm.delay(0.36)
    >>> grid = dtm.stability.tiles(
    ...     h, {"Kp": (0.1, 6), "Kv": (-0.9, 0.9)}, shape=(100_000, 100_000)
    ... )
    >>> grid
    <100 by 100 tiles of Kp and Kv, 10000000000 cells>
    >>> tile = grid[10, 50]
    >>> tile.place[0], tile.map(abscissa=False).unstable.shape
    (slice(10000, 11000, None), (1000, 1000))
    """
    axes = map_axes(ranges, shape, least=1, most=math.inf)
    sizes = two_sizes("tile", tile, least=1)
    lengths = [len(points) for points in axes.values()]
    first, second = (
        tuple(min(part, length - start) for start in range(0, length, part))
        for length, part in zip(lengths, sizes, strict=True)
    )
    return Tiles(family, axes, numbers_at(at, tuple(axes)), (first, second))
