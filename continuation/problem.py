"""Define a problem: a residual and its kind of stability; and the start of a branch."""

import abc
from collections.abc import Callable, Mapping
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
from .representation import AbstractRepresentation, Unique


class Start(eqx.Module):
    """The start of a branch: a problem, a state, and optionally a direction.

    Examples:
        >>> import continuation
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> start = continuation.Start(problem, np.ones(1), parameter=1.0)
        >>> next(continuation.follow(problem, start, "a", (-1, 2))).parameter
        1.0
    """

    problem: "AbstractProblem"
    """The problem to follow."""
    state: np.ndarray
    """State on the branch or near it, shape `(n,)`."""
    parameter: float | None = None
    """Value of the parameter; default that of `problem.parameters`."""
    tangent: np.ndarray | None = None
    """Direction (state, parameter) in which the branch leaves, `(n+1,)`; its length is
    immaterial. The first point is sought in the plane across it, so that the new branch
    at a branch point is found, not the known branch. Default: along the branch through
    `state`, in the requested direction."""
    step: float | None = None
    """First step; default that of the settings."""
    reason: str = eqx.field(static=True, default="")
    """A remark on the first point."""


class AbstractProblem(eqx.Module):
    """G(u, parameters) = 0 with u of shape (n,) and G of shape (n,).

    **To state a problem of your own**, subclass and give

    - `parameters`, a field: any pytree (a dict, a module, a system). Its scalar float
      leaves can be continued in, picked with `where(parameters)`. The methods get a
      tree of the same structure as an argument and must use that one, never the field.
    - `stability`, a class attribute: `"equilibrium"` where eigenvalues of the
      linearisation on the imaginary axis mark bifurcations, `"map"` if those on the
      unit circle do (fixed points, periodic orbits), `"none"` otherwise.
    - `residual(u, parameters)`.

    The other methods have defaults. **Traced** (called inside compiled programs; jax
    functions, differentiable forward): `residual`, `linearisation`, `derivatives`,
    `local_dynamics`, `seen`, `watched`, `scale`. All their non-array data must be
    static: one program is compiled for each structure of a problem, and reused for all
    values of arrays in it. `residual` and monitors of `ends=False` are to be smooth;
    where an orbit does not exist return NaN, and the step is halved.

    **Python** (called between compiled programs with concrete arrays): `monitors`,
    `check`, `transition`, `refreshed`, `eigenvalues`, `representation`, `signature`,
    `with_signature`. They may compile their own programs.

    The order of calls for a step from point a to point b: corrector; `derivatives` and
    `seen` at b in the same program; if a monitor with `ends` changed sign, its zero is
    located, yielded as a special point, and `transition` is asked for a `Start` (None:
    the branch ends); otherwise `check(point b)`, and if it gives a reason, the zero of
    an ending monitor is sought between a and b, then the step is halved, and at the
    smallest step the branch ends with that reason. Then `refreshed` at b.

    Curves in two parameters need nothing more: the core extends the problem with
    the condition `linearisation is singular` or `monitor = 0`.

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
    """Any pytree with scalar floats among its leaves."""
    stability: eqx.AbstractClassVar[StabilityKind]
    """`"equilibrium"`, `"map"` or `"none"`."""
    normal_forms: ClassVar[bool] = True
    """Whether `local_dynamics` is available, for the coefficients of normal forms."""
    costly: ClassVar[bool] = False
    """Whether second derivatives of `residual` take long to compile, so that special
    points are rather enclosed than solved for; `local_dynamics` then has only a
    Jacobian."""
    detects: ClassVar[bool] = True
    """Whether folds, branch points and bifurcations of `stability` are sought."""

    # -- equations

    @abc.abstractmethod
    def residual(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        """Return G(u, parameters), zero on the branch.

        Returns:
            Shape `(n,)`.
        """

    def linearisation(
        self, u: Float[Array, " n"], parameters: PyTree, jacobian: Float[Array, "n n"]
    ) -> Float[Array, "k k"]:
        """Return the matrix whose eigenvalues decide stability.

        By default dG/du for equilibria, and dG/du + I for maps, right for G = f(u) - u.
        Multiple shooting overrides this with the monodromy matrix, autonomous orbits
        with that of the map on a section (no trivial multiplier).

        Returns:
            Shape `(k, k)`.
        """
        del u, parameters
        if self.stability == "map":
            return jacobian + jnp.eye(jacobian.shape[0], dtype=jacobian.dtype)
        return jacobian

    def derivatives(
        self, u: Float[Array, " n"], p: Float[Array, ""], parameters_at: Callable
    ) -> tuple[Float[Array, "n n+1"], Float[Array, "k k"]]:
        """Return the derivative of the residual by u and the parameter, and
        `linearisation`.

        Override it where the two share work.

        Args:
            p: Value of the parameter.
            parameters_at: `parameters_at(p)` are the parameters with the value p of the
                one that varies.

        Returns:
            Shapes `(n, n+1)` and `(k, k)`.
        """
        whole = jax.jacfwd(lambda z: self.residual(z[:-1], parameters_at(z[-1])))(
            jnp.append(u, p)
        )
        return whole, self.linearisation(u, parameters_at(p), whole[:, :-1])

    def local_dynamics(
        self, u: Float[Array, " n"], parameters: PyTree
    ) -> LocalDynamics:
        """Return the vector field or map around a solution.

        Normal-form coefficients come from its first three derivatives; its eigenvalues
        must be those of `linearisation`, and any number of others off the imaginary
        axis or the unit circle. By default G, or G + u for maps. Override it together
        with `linearisation`, or set `normal_forms` to False.

        Returns:
            A `LocalDynamics`.
        """

        def motion(y):
            moved = self.residual(y, parameters)
            return moved + y if self.stability == "map" else moved

        return LocalDynamics(u, motion, jax.jacfwd(motion))

    def scale(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        """Return the scales of the components of u, by which lengths are measured.

        By default 1, or the root mean square of u where that is more.

        Returns:
            Shape `(n,)`.
        """
        del parameters
        size = jnp.maximum(1.0, jnp.sqrt(jnp.mean(u * u)))
        return jnp.broadcast_to(size, u.shape)

    # -- monitors

    def monitors(self) -> Mapping[str, Monitor]:
        """Return the test functions of this problem by name; may depend on its
        structure only.

        Returns:
            Monitors by name.
        """
        return {}

    def seen(
        self, u: Float[Array, " n"], parameters: PyTree
    ) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return the values of the test functions, and further quantities to keep.

        Returns:
            The values by the names in `monitors`, and the quantities kept in
                `point.observed`.
        """
        del u, parameters
        return {}, {}

    def watched(
        self, number: int | Int[Array, ""], u: Float[Array, " n"], parameters: PyTree
    ) -> Float[Array, ""]:
        """Return one of the monitors alone, by its place in `monitors`.

        A traced number lets one program find the zeros of all of them. Where one of
        them has `bracket`, numbers are integers. Override it where this is less
        work than `seen`.

        Returns:
            A scalar.
        """
        values, _ = self.seen(u, parameters)
        return jnp.stack([values[name] for name in self.monitors()])[number]

    # -- between compiled programs

    def check(self, point: Any) -> str | None:
        """Return None if the point is admissible, otherwise the reason as text.

        Returns:
            A sentence, or None.
        """
        del point
        return None

    def transition(self, point: Any, at: Any) -> Start | None:
        """Return the problem with which to continue from a special point.

        It is called for the zero of a monitor that ends this problem: return the
        problem beyond it (same `parameters`). It is called when a branch is switched at
        a flip: return a problem whose solutions include this orbit run through twice,
        its state, and the tangent (direction of the eigenvector of -1, parameter
        component 0); at a Hopf point: the limit cycle that emerges there.

        Args:
            point: The [`continuation.Point`][].
            at: The corrector's matrices and values at it: `at.linearisation`,
                `at.jacobian`, `at.monitors`.

        Returns:
            A `Start`, or None where there is no continuation.
        """
        del point, at
        return None

    def refreshed(self, u: np.ndarray, parameters: PyTree) -> "AbstractProblem":
        """Return the same problem with its internal references taken from this point.

        References are borders and phase conditions. They must depend on the point only,
        not on the history, so that a resumed branch is identical; only
        signs may be chosen by those before, and must be, where test functions depend on
        them. Structure and shapes stay.

        Returns:
            A problem.
        """
        del u, parameters
        return self

    def eigenvalues(
        self, u: np.ndarray, parameters: PyTree, at: Any
    ) -> tuple[Any, str]:
        """Return the eigenvalues of `at.linearisation`, and a remark on them.

        Override it where the matrix is unbounded at some points, with the limits.

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
        """The non-array part of this problem, as text; saved with every point."""
        return ""

    def with_signature(self, signature: str) -> "AbstractProblem":
        """Return the problem that has this signature, to resume a saved branch.

        Returns:
            A problem.

        Raises:
            ValueError: The signature is not one of this problem.
        """
        if signature != self.signature:
            raise ValueError(
                f"the saved branch has signature {signature!r}, this problem "
                f"{self.signature!r}; take it up with the problem it was made with"
            )
        return self


def jacobian_of(problem: AbstractProblem, u: Float[Array, " n"], parameters: PyTree):
    """dG/du, shape (n, n)."""
    return jax.jacfwd(problem.residual)(u, parameters)
