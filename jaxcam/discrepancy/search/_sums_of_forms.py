"""Find sums of parametric forms that resemble a free function.

All pairs of forms are compared on a grid of their parameters, and each pair is extended
by a third form. The most promising sums are refined. These computations use the
quadratic likelihood of the function, so no trajectory is integrated.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..terms import BACKWARD, DRY, FORWARD, MOST_PARTS, Primitive, sum_of
from ._curve_likelihood import CurveLikelihood, Start, starts_of, Vectors
from ._named_parts import without_friction


# Squared correlation above which the data do not distinguish two forms
_ALIKE = 0.95
# Number of sums of each size that are refined
_REFINED = 8
# Minimum increase in gain for which a part is replaced by another
_MORE = 0.1


class _Sum(NamedTuple):
    """A sum of forms, with its parameters and its `gain` (defined in `Start`)."""

    gain: float
    parts: tuple[Primitive, ...]
    numbers: np.ndarray

    @property
    def own(self) -> list[np.ndarray]:
        """The parameters of each part."""
        ends = np.cumsum([part.count for part in self.parts])
        return np.split(self.numbers, ends[:-1])

    @property
    def form(self) -> Primitive:
        return sum_of(self.parts, [own[0] for own in self.own])

    @property
    def scales(self) -> np.ndarray:
        """Significant changes of the parameters."""
        return np.array([abs(self.numbers[0]), *self.form.scales])

    def without(self, k: int) -> "_Sum":
        """Return the sum without one of its parts."""
        parts, own = list(self.parts), self.own
        del parts[k], own[k]
        return self._replace(parts=tuple(parts), numbers=np.concatenate(own))


def _best_of(sums: Iterable[_Sum]) -> list[_Sum]:
    """Return the best sum for each combination of forms, in order of decreasing
    gain.
    """
    ranked = sorted(sums, key=lambda one: one.gain)
    best = {tuple(sorted(part.name for part in one.parts)): one for one in ranked}
    return sorted(best.values(), key=lambda one: -one.gain)


class _Grid(NamedTuple):
    """Forms with all their starting values, one row for each.

    - `rows`: for each form, the rows that belong to it.
    - `numbers`: for each form, the parameters of these rows.
    - `seen`: for each row, the vector of the form (see `Vectors`), scaled to length
        one; `sizes`: the size parameters of the scaled forms.
    """

    forms: tuple[Primitive, ...]
    rows: list[slice]
    numbers: list[np.ndarray]
    seen: Float[np.ndarray, "n k"]
    sizes: Float[np.ndarray, " n"]

    def form_of(self, row: int) -> int:
        """Return the index of the form to which a row belongs."""
        return next(k for k, rows in enumerate(self.rows) if row < rows.stop)

    def start_of(self, row: int, size: float) -> tuple[Primitive, np.ndarray]:
        """Return the form of a row, and its parameters for `size` times its vector."""
        kind = self.form_of(row)
        numbers = self.numbers[kind][row - self.rows[kind].start].copy()
        numbers[0] = size * self.sizes[row]
        return self.forms[kind], numbers


class SumSearch:
    """A search for sums of forms that are about as likely as a function.

    A function is represented by one of the `Vectors`.

    **Arguments:** the likelihood, and the minimum squared length of a part of a sum,
    relative to that of the most likely function.
    """

    def __init__(self, likelihood: CurveLikelihood, least: float = 0.0):
        self.likelihood, self.least = likelihood, least
        self.vectors = Vectors(likelihood)
        self.best = self.vectors.best
        self.grid = self._grid()

    def promising(self, most: int) -> list[Start]:
        """Return the sums with the largest predicted gains, at most `most` of them."""
        guesses, found = _best_of(self._pairs()), []
        for count in range(2, MOST_PARTS + 1):
            if count > 2:
                longer = [self._extended(one) for one in guesses]
                guesses = _best_of(itertools.chain(*longer))
            found += self._refined(guesses[:_REFINED])
        found = _best_of([*found, *self._exchanged(found)])
        return [Start(one.gain, one.form, one.numbers) for one in found[:most]]

    def with_friction(self, most: int) -> list[tuple[Primitive, np.ndarray]]:
        """Return the sums of two forms of the velocity, with their parameters, that
        contain Coulomb friction, the most likely first.
        """
        pairs = [
            one
            for one in _best_of(self._pairs())
            if without_friction(one.form, one.numbers) is not None
        ]
        found = _best_of([*self._refined(pairs[:_REFINED]), *self._one_sided()])
        return [(one.form, one.numbers) for one in found[:most]]

    def _one_sided(self) -> Iterator[_Sum]:
        """Yield sums of Coulomb friction and friction in one direction of motion.

        Forces in the two directions may be much alike, so the other sums leave them
        out.
        """
        for form, sense in ((FORWARD, 1.0), (BACKWARD, -1.0)):
            parts = DRY, form
            seen = np.array([self.vectors.seen(part, np.ones(1)) for part in parts])
            sizes = np.linalg.lstsq(seen.T, self.best, rcond=None)[0]
            gain = float(self.best @ (sizes @ seen)) - 2 * self.likelihood.price
            # both oppose the motion
            if sizes[0] < 0 and sense * sizes[1] < 0:
                yield _Sum(gain, parts, sizes)

    def _exchanged(self, sums: Sequence[_Sum]) -> list[_Sum]:
        """Return the sums obtained from the best one by replacing one part at a time,
        as long as the gain increases.
        """
        every: list[_Sum] = []
        best = max(sums, key=lambda one: one.gain, default=None)
        while best is not None:
            rests = self._refined([best.without(k) for k in range(len(best.parts))])
            others = itertools.chain(*(self._extended(one) for one in rests))
            found = _best_of(self._refined(_best_of(others)[:_REFINED]))
            every += found
            ahead = found and found[0].gain > best.gain + _MORE
            best = found[0] if ahead else None
        return every

    def _grid(self) -> _Grid:
        forms, rows, numbers, seen, first = [], [], [], [], 0
        for form in self.likelihood.family.summands:
            starts = starts_of(form)
            starts = starts[[form.within(own) for own in starts]]
            here = self.vectors.seen(form, starts)
            size = np.linalg.norm(here, axis=1)
            visible = size > 0
            if not np.any(visible):
                continue
            starts, here = starts[visible], here[visible] / size[visible, None]
            starts[:, 0] = 1 / size[visible]
            forms.append(form)
            rows.append(slice(first, first + len(starts)))
            numbers.append(starts)
            seen.append(here)
            first += len(starts)
        sizes = np.concatenate([np.zeros(0), *(own[:, 0] for own in numbers)])
        seen = np.concatenate([np.zeros((0, len(self.best))), *seen])
        return _Grid(tuple(forms), rows, numbers, seen, sizes)

    def _pairs(self) -> Iterator[_Sum]:
        """Yield the best sum of each pair of forms on the grid."""
        grid, price = self.grid, self.likelihood.price
        told = grid.seen @ self.best
        kinds = range(len(grid.forms))
        for a, b in itertools.combinations_with_replacement(kinds, 2):
            if grid.forms[a].odd != grid.forms[b].odd:
                continue
            one, other = grid.rows[a], grid.rows[b]
            alike = grid.seen[one] @ grid.seen[other].T
            s, t = told[one, None], told[None, other]
            apart = np.where(alike**2 < _ALIKE, 1 - alike**2, np.inf)
            gains = (s**2 + t**2 - 2 * alike * s * t) / apart
            i, j = np.unravel_index(np.argmax(gains), gains.shape)
            pair = [one.start + int(i), other.start + int(j)]
            seen = grid.seen[pair]
            if not np.isfinite(apart[i, j]):
                continue
            sizes = np.linalg.solve(seen @ seen.T, seen @ self.best)
            each = [grid.start_of(row, size) for row, size in zip(pair, sizes)]
            parts = tuple(form for form, _ in each)
            count = sum(form.count for form in parts)
            numbers = np.concatenate([own for _, own in each])
            if all(sizes):
                yield _Sum(float(gains[i, j]) - count * price, parts, numbers)

    def _extended(self, one: _Sum) -> Iterator[_Sum]:
        """Yield the sum extended by each of the forms in turn.

        Changes in the parameters of the sum are taken into account to first order.
        """
        grid, price = self.grid, self.likelihood.price
        across = np.linalg.qr(self.vectors.slopes(one.form, one.numbers, one.scales))[0]
        left = self.best - self.vectors.seen(one.form, one.numbers)
        left -= across @ (across.T @ left)
        inside = grid.seen @ across
        squares = 1 - np.sum(inside**2, axis=1)
        apart = np.where(squares > 1 - _ALIKE, squares, np.inf)
        # the remainder is already perpendicular to the changes in the sum
        sizes = grid.seen @ left / apart
        gains = sizes**2 * squares
        so_far = self.best @ self.best - left @ left - one.form.count * price
        for form, rows in zip(grid.forms, grid.rows):
            row = rows.start + int(np.argmax(gains[rows]))
            if form.odd != one.parts[0].odd or sizes[row] == 0:
                continue
            form, own = grid.start_of(row, float(sizes[row]))
            gain = float(so_far + gains[row] - form.count * price)
            yield _Sum(gain, (*one.parts, form), np.append(one.numbers, own))

    def _refined(self, sums: Sequence[_Sum]) -> list[_Sum]:
        """Optimise the parameters of sums, and return the sums with valid parameters
        whose parts are all significant.
        """
        found = []
        for one in sums:
            gain, form, numbers = self.vectors.refined(one.form, one.numbers)
            best = one._replace(gain=gain, numbers=numbers)
            sensible = form.within(numbers) and np.isfinite(gain)
            if sensible and self._counts(best):
                found.append(best)
        return found

    def _counts(self, one: _Sum) -> bool:
        """Return whether every part of a sum is large enough and can be distinguished
        from the others by the data.
        """
        each = [self.vectors.seen(*own) for own in zip(one.parts, one.own)]
        sizes = np.array([np.linalg.norm(own) for own in each])
        if not np.all(sizes**2 > self.least * (self.best @ self.best)):
            return False
        units = np.array(each) / sizes[:, None]
        return bool(np.all(np.triu(units @ units.T, 1) ** 2 <= _ALIKE))
