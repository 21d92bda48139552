"""Grids of initial states, which are the centres of cells."""

import equinox as eqx
import numpy as np


class Grid(eqx.Module):
    """A box of states, divided into equal cells.

    Raises:
        ValueError: The lengths are inconsistent.

    Examples:
        >>> from jaxcam.sweeps import Grid
        >>> Grid([0.0, -1.0], [1.0, 1.0], [4, 2]).states().shape
        (8, 2)
    """

    low: tuple[float, ...] = eqx.field(converter=lambda x: tuple(map(float, x)))
    """Lower corner of the box, one number per component of the state."""
    high: tuple[float, ...] = eqx.field(converter=lambda x: tuple(map(float, x)))
    """Upper corner of the box, one number per component of the state."""
    shape: tuple[int, ...] = eqx.field(
        converter=lambda x: tuple(map(int, x)), static=True
    )
    """Number of cells along each component; 1 if the component does not vary."""

    def __check_init__(self):
        if not len(self.low) == len(self.high) == len(self.shape) > 0:
            raise ValueError(
                f"low has {len(self.low)} numbers, high {len(self.high)} and shape "
                f"{len(self.shape)}; give one in each for every component of the state"
            )
        if not np.all(np.isfinite([*self.low, *self.high])):
            raise ValueError("low and high must be finite numbers")
        for low, high, count in zip(self.low, self.high, self.shape, strict=True):
            if count < 1 or high < low or (count > 1 and high == low):
                raise ValueError(
                    f"{count} cells from {low:g} to {high:g} are not possible; give 1 "
                    "or more cells, and low below high"
                )

    @property
    def sizes(self) -> np.ndarray:
        """Extent of a cell along each component, shape `(n,)`."""
        return self.extents / np.array(self.shape)

    @property
    def extents(self) -> np.ndarray:
        """Extent of the box, shape `(n,)`."""
        return np.array(self.high) - np.array(self.low)

    def centres(self, axis: int) -> np.ndarray:
        """Return the centres of the cells along one component.

        Args:
            axis: Index of the component.

        Returns:
            Centres, shape `(cells,)`.

        Examples:
            >>> from jaxcam.sweeps import Grid
            >>> Grid([0.0, -1.0], [1.0, 1.0], [4, 2]).centres(0).tolist()
            [0.125, 0.375, 0.625, 0.875]
        """
        count = self.shape[axis]
        return self.low[axis] + self.sizes[axis] * (np.arange(count) + 0.5)

    def states(self, first: int = 0, last: int | None = None) -> np.ndarray:
        """Return the centres of the cells, with the last component varying fastest.

        Args:
            first: Index of the first cell along the first component.
            last: Index after that of the last cell along the first component;
                default: all cells.

        Returns:
            Centres, shape `(motions, n)`.
        """
        axes = [self.centres(i) for i in range(len(self.shape))]
        axes[0] = axes[0][first:last]
        parts = np.meshgrid(*axes, indexing="ij")
        return np.stack([part.ravel() for part in parts], axis=1)

    def cells(self, states) -> np.ndarray:
        """Return the index of the cell of each state; -1 outside the grid.

        Args:
            states: States, shape `(motions, n)`.

        Returns:
            Indices in the order of the method `states`, shape `(motions,)`.

        Examples:
            >>> from jaxcam.sweeps import Grid
            >>> grid = Grid([0.0, -1.0], [1.0, 1.0], [4, 2])
            >>> grid.cells([[0.3, 0.5], [2.0, 0.0]]).tolist()  # the second is outside
            [3, -1]
        """
        states = np.asarray(states, dtype=float)
        sizes = np.where(self.sizes > 0, self.sizes, 1.0)
        with np.errstate(invalid="ignore"):
            place = np.floor((states - np.array(self.low)) / sizes)
        # a component that does not vary does not distinguish cells
        place = np.where(np.array(self.shape) == 1, 0.0, place)
        inside = np.all((place >= 0) & (place < np.array(self.shape)), axis=-1)
        safe = np.where(inside[..., None], place, 0).astype(int)
        index = np.ravel_multi_index(tuple(np.moveaxis(safe, -1, 0)), self.shape)
        return np.where(inside, index, -1)
