"""Problems, defined by a residual and a kind of stability."""

import abc
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from ._eigenvalues import eigenvalues_of
from ._local_dynamics import (
    LocalDynamics as LocalDynamics,
    StabilityKind as StabilityKind,
)
from ._monitor import Monitor as Monitor
from ._padding import Padded
from ._start import Start as Start
from .representation import AbstractRepresentation, Unique


class AbstractProblem(eqx.Module):
    """A problem G(u, parameters) = 0 with u of shape (n,) and G of shape (n,).

    **To define a problem of your own**, subclass this class and provide

    - `parameters`, a field: any pytree (a dict, a module, a system). Its scalar float
        leaves can be continuation parameters, selected with `where(parameters)`. The
        methods receive a tree of the same structure as an argument and must use that
        argument, never the field.
    - `stability`, a class attribute: `"equilibrium"` if eigenvalues of the
        linearisation on the imaginary axis mark bifurcations, `"map"` if those on the
        unit circle do (fixed points and periodic orbits), `"none"` otherwise.
    - `residual(u, parameters)`.

    The other methods have defaults. **Traced** (called inside compiled programs; JAX
    functions, differentiable in forward mode): `residual`, `linearisation`,
    `derivatives`, `local_dynamics`, `seen`, `watched`, `scale`, `number_of_unknowns`.
    All their non-array data must be static, because one program is compiled for each
    problem structure and reused for all array values in it. `residual` and monitors
    with `ends=False` must be smooth, except for monitors with `corner`; where an orbit
    does not exist, return NaN, and the step is halved.

    **Python** (called between compiled programs, with concrete arrays): `monitors`,
    `kind_of_zero`, `check`, `transition`, `refreshed`, `eigenvalues`, `representation`,
    `signature`, `with_signature`, `padded`, `accumulation`, `touching`, `may_touch`.

    **Order of calls** for a step from point a to point b: first the corrector, then
    `derivatives` and `seen` at b in the same program. If a monitor with `ends` has
    changed sign, its zero is located and yielded as a special point, and `transition`
    is called for a `Start` (None: the branch ends). Otherwise, `check(point b)` is
    called. If it returns a reason, a zero of an ending monitor is searched for between
    a and b, and then the step is halved; at the smallest step, the branch ends with
    that reason. Finally, `refreshed` is called at b.

    Nothing else is needed for curves in two parameters: the problem is extended by the
    condition that the linearisation is singular or that a monitor is zero.

    Examples:
        >>> import continuation
        >>> class Parabola(continuation.AbstractProblem):
        ...     parameters: dict
        ...     stability = "equilibrium"
        ...     def residual(self, u, parameters):
        ...         return parameters["a"] - u**2
        >>> problem = Parabola({"a": 1.0})
        >>> found = continuation.branch(problem, [1.0], "a", (-1, 2), direction=-1)
        >>> found.special[0].kind
        'fold'
    """

    parameters: eqx.AbstractVar[PyTree]
    """The parameters: any pytree with scalar floats among its leaves."""
    stability: eqx.AbstractClassVar[StabilityKind]
    """`"equilibrium"`, `"map"` or `"none"`."""
    normal_forms: ClassVar[bool] = True
    """Whether `local_dynamics` is available for normal-form coefficients."""
    costly: ClassVar[bool] = False
    """Whether second derivatives of `residual` take a long time to compile, so that
    special points are bracketed rather than solved for; `local_dynamics` then has only
    a Jacobian.
    """
    detects: ClassVar[bool] = True
    """Whether to search for folds, branch points and the bifurcations of
    `stability`.
    """

    # -- equations

    @abc.abstractmethod
    def residual(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        """Return G(u, parameters), which is zero on the branch.

        Returns:
            Residuals, shape `(n,)`.
        """

    def linearisation(
        self, u: Float[Array, " n"], parameters: PyTree, jacobian: Float[Array, "n n"]
    ) -> Float[Array, "k k"]:
        """Return the matrix whose eigenvalues determine stability.

        By default, it is dG/du for equilibria and dG/du + I for maps; this is correct
        for G = f(u) - u. Multiple shooting overrides this with the monodromy matrix;
        without forcing, the override returns the derivative of the map on a section
        (without the trivial multiplier).

        Returns:
            The matrix, shape `(k, k)`.
        """
        del u, parameters
        if self.stability == "map":
            return jacobian + jnp.eye(jacobian.shape[0], dtype=jacobian.dtype)
        return jacobian

    def derivatives(
        self, u: Float[Array, " n"], p: Float[Array, ""], parameters_at: Callable
    ) -> tuple[Float[Array, "n n+1"], Float[Array, "k k"]]:
        """Return the derivative of the residual with respect to u and the parameter,
        and `linearisation`.

        Override this method if the two share computations.

        Args:
            p: Value of the parameter.
            parameters_at: Function of p that returns the parameters with the varying
                one set to p.

        Returns:
            The derivative, shape `(n, n+1)`, and the matrix, shape `(k, k)`.
        """
        whole = jax.jacfwd(lambda z: self.residual(z[:-1], parameters_at(z[-1])))(
            jnp.append(u, p)
        )
        return whole, self.linearisation(u, parameters_at(p), whole[:, :-1])

    def local_dynamics(
        self, u: Float[Array, " n"], parameters: PyTree
    ) -> LocalDynamics:
        """Return the vector field or map around a solution.

        Normal-form coefficients are computed from its first three derivatives. The
        eigenvalues of its Jacobian must include those of `linearisation`; any others
        must not lie on the imaginary axis or the unit circle. The default is G, or G +
        u for maps. Override this method together with `linearisation`, or set
        `normal_forms` to False.

        Returns:
            A `LocalDynamics`.
        """

        def motion(y):
            moved = self.residual(y, parameters)
            return moved + y if self.stability == "map" else moved

        return LocalDynamics(u, motion, jax.jacfwd(motion))

    def scale(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        """Return the scales of the components of u, in which lengths are measured.

        By default, the scale is 1, or the root mean square of u if that is larger.

        Returns:
            Scales, shape `(n,)`.
        """
        del parameters
        size = jnp.maximum(1.0, jnp.sqrt(jnp.mean(u * u)))
        return jnp.broadcast_to(size, u.shape)

    def number_of_unknowns(self, u: Float[Array, " n"]) -> Any:
        """Return the number n of unknowns, without padding.

        Returns:
            A number.
        """
        return u.size

    # -- monitors

    def monitors(self) -> Mapping[str, Monitor]:
        """Return the test functions of this problem by name; they may depend only on
        its structure.

        Returns:
            Monitors by name.
        """
        return {}

    def seen(
        self, u: Float[Array, " n"], parameters: PyTree
    ) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return the values of the test functions, and further quantities to store.

        Returns:
            The values, keyed by the names in `monitors`, and the quantities to store in
                `point.observed`.
        """
        del u, parameters
        return {}, {}

    def watched(
        self, number: int | Int[Array, ""], u: Float[Array, " n"], parameters: PyTree
    ) -> Float[Array, ""]:
        """Return the value of one monitor, given its index in `monitors`.

        With a traced index, one program finds the zeros of all monitors. If one of the
        monitors has `bracket`, indices are integers. Override this method if one value
        is cheaper to compute than `seen`.

        Returns:
            A scalar.
        """
        values, _ = self.seen(u, parameters)
        return jnp.stack([values[name] for name in self.monitors()])[number]

    # -- between compiled programs

    def padded(self) -> Padded | None:
        """Return the problem with additional unknowns that compiled programs use.

        Problems of different sizes can then share a program.

        Returns:
            A [`continuation.Padded`][], or None for the problem itself.
        """
        return None

    def kind_of_zero(
        self, name: str, before: tuple[Any, PyTree], after: tuple[Any, PyTree]
    ) -> str | None:
        """Return the kind of the special point at a zero of a monitor, or None if it is
        not to be reported.

        By default, it is the `kind` of the monitor.

        Args:
            name: Name of the monitor.
            before: Unknowns and parameters just before the point.
            after: Unknowns and parameters just after the point.

        Returns:
            A kind, or None.
        """
        del before, after
        return self.monitors()[name].kind

    def check(self, point: Any) -> str | None:
        """Return None if the point is admissible, otherwise the reason why it is not.

        Returns:
            A sentence, or None.
        """
        del point
        return None

    def transition(self, point: Any, at: Any) -> Start | None:
        """Return the problem with which to continue from a special point.

        This method is called in three cases. At the zero of a monitor that ends this
        problem, return the problem beyond the zero (with the same `parameters`). When a
        branch is switched at a flip, return a problem whose solutions include this
        orbit traversed twice, the state of that solution, and the tangent (the
        eigenvector of -1, with parameter component 0). At a Hopf point, return the
        limit cycle that emerges there.

        Args:
            point: The [`continuation.Point`][].
            at: The corrector's matrices and values at the point: `at.linearisation`,
                `at.jacobian`, `at.monitors`.

        Returns:
            A `Start`, or None if there is no continuation.
        """
        del point, at
        return None

    def accumulation(self, points: Sequence[Any]) -> Start | None:
        """Return the problem beyond infinitely many transitions, if they accumulate.

        This method is called before `transition`.

        Args:
            points: The special points at which the problem has changed so far.

        Returns:
            A `Start` at the accumulation, or None.
        """
        del points
        return None

    @property
    def may_touch(self) -> bool:
        """Whether `touching` may find a grazing."""
        return False

    def touching(self, context: Any, at: Any, reach: float) -> Any:
        """Return a grazing that two branches share, close ahead of `at`, or None."""
        del context, at, reach
        return None

    def refreshed(self, u: np.ndarray, parameters: PyTree) -> "AbstractProblem":
        """Return the same problem with its internal references updated at this point.

        References are the vectors that border a singular matrix, and phase conditions.
        They must depend only on the point and not on the history, so that a resumed
        branch is identical. Signs are an exception: if test functions depend on the
        sign of a reference, choose the sign that matches the previous one. Structure
        and shapes must not change.

        Returns:
            A problem.
        """
        del u, parameters
        return self

    def eigenvalues(
        self, u: np.ndarray, parameters: PyTree, at: Any
    ) -> tuple[Any, str]:
        """Return the eigenvalues of `at.linearisation`, and a remark on them.

        Override this method if the matrix is unbounded at some points, to return the
        limits of the eigenvalues at these points.

        Args:
            at: The corrector's matrices and values.

        Returns:
            Eigenvalues `(k,)`, complex, largest modulus first; and a sentence, or the
                empty string.
        """
        del u, parameters
        return eigenvalues_of(at.linearisation), ""

    @property
    def representation(self) -> AbstractRepresentation:
        """The representations of a solution."""
        return Unique(self.signature)

    @property
    def signature(self) -> str:
        """The non-array part of this problem as text, saved with every point."""
        return ""

    def with_signature(self, signature: str) -> "AbstractProblem":
        """Return the problem with this signature, to resume a saved branch.

        Returns:
            A problem.

        Raises:
            ValueError: The signature does not belong to this problem.
        """
        if signature != self.signature:
            raise ValueError(
                f"the saved branch has signature {signature!r}, but this problem has "
                f"{self.signature!r}; use the problem with which it was computed"
            )
        return self
