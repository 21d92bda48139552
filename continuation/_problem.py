"""What is followed: a residual, its kind of stability, and what to watch on the way."""

import abc
from collections.abc import Callable, Mapping
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from ._eigenvalues import eigenvalues_of


#: what the eigenvalues of `linearisation` mean
Stability = Literal["equilibrium", "map", "none"]


class Monitor(eqx.Module):
    """A test function that a problem adds, and what its zero means.

    **Arguments:**

    - `kind`: name of the special point at its zero, such as `"grazing"`.
    - `ends`: the branch of this problem ends there. `AbstractProblem.transition` is
      then asked for another problem to go on with. The zero of such a monitor is also
      looked for ahead of the last point, when a step fails or its result is refused; so
      the monitor may cease to exist, or not change sign, behind its zero. It must have
      a nonzero slope on the near side.
    - `bracket`: its zero is enclosed by points of the branch instead of solved for by
      Newton's method; for values whose derivative is costly to compile.
    """

    kind: str = eqx.field(static=True)
    ends: bool = eqx.field(static=True, default=False)
    bracket: bool = eqx.field(static=True, default=False)


class Start(eqx.Module):
    """Where to begin a branch, and with which problem.

    **Arguments:**

    - `problem`: what is to be followed.
    - `state`: (n,) state, on the branch or near it.
    - `parameter`: value of the parameter; None: the one that `problem.parameters` has.
    - `tangent`: (n+1,) direction (state, parameter) in which the branch leaves; its
      length is immaterial. The first point is sought in the plane across it, so a
      branch that leaves a branch point is found and not the one that was known. None:
      along the branch through `state`, in the direction asked for.
    - `step`: first step; None: as the settings say.
    - `reason`: what is to be known about the first point.
    """

    problem: "AbstractProblem"
    state: np.ndarray
    parameter: float | None = None
    tangent: np.ndarray | None = None
    step: float | None = None
    reason: str = eqx.field(static=True, default="")


class AbstractProblem(eqx.Module):
    """G(u, parameters) = 0 with u of shape (n,) and G of shape (n,).

    **To state a problem of your own**, subclass and give

    - `parameters`, a field: any pytree (a dict, a module, a system). Its scalar float
      leaves can be continued in, picked with `where(parameters)`. The methods get a
      tree of the same structure as an argument and must use that one, never the field.
    - `stability`, a class attribute or static field: `"equilibrium"` where eigenvalues
      of the linearisation on the imaginary axis are bifurcations, `"map"` where those
      on the unit circle are (fixed points, periodic orbits), `"none"` otherwise.
    - `residual(u, parameters)`.

    **Traced** (called inside compiled programs; jax functions, differentiable forward):
    `residual`, `jacobian`, `linearisation`, `derivatives`, `motion`, `local_motion`,
    `local_jacobian`, `monitor`, `observe`, `watched`,
    `watched_by_number`, `seen`, `scale`.
    Everything about them that is not an array must be static: one program is compiled
    for each structure of a problem, and reused for all values of arrays in it.
    `residual` and monitors of `ends=False` are to be smooth; where an orbit does not
    exist return NaN, and the step is halved.

    **Python** (called between compiled programs with concrete arrays): `monitors`,
    `check`, `transition`, `refreshed`, `doubled`, `copies`, `brought_near`, `family`,
    `half_away`, `eigenvalues`, `signature`, `with_signature`. They may compile things
    of their own.

    The order of calls for a step from point a to point b: corrector; `monitor` and
    `linearisation` and `observe` at b in the same program; if a monitor with `ends`
    changed sign, its zero is located, yielded as a special point, and
    `transition(point)` is asked for a `Start` (None: the branch ends); otherwise
    `check(point b)`, and if it gives a reason, the zero of an ending monitor is sought
    between a and b, then the step is halved, and at the smallest step the branch ends
    with that reason. Then `refreshed` at b.

    Curves in two parameters need nothing more: the core extends the problem with
    the condition `linearisation is singular` or `monitor = 0`.
    """

    parameters: eqx.AbstractVar[PyTree]
    stability: eqx.AbstractClassVar[Stability]

    @abc.abstractmethod
    def residual(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        """G(u, parameters), zero on the branch."""

    def jacobian(self, u: Float[Array, " n"], parameters: PyTree):
        """dG/du, shape (n, n)."""
        return jax.jacfwd(self.residual)(u, parameters)

    def linearisation(
        self, u: Float[Array, " n"], parameters: PyTree, jacobian: Float[Array, "n n"]
    ) -> Float[Array, "k k"]:
        """Matrix whose eigenvalues decide stability; `jacobian` is dG/du at the point.

        By default dG/du for equilibria, and dG/du + I for maps, right for G = f(u) - u.
        Multiple shooting overrides this with the monodromy matrix, autonomous orbits
        with that of the map on a section (no trivial multiplier).
        """
        del u, parameters
        if self.stability == "map":
            return jacobian + jnp.eye(jacobian.shape[0], dtype=jacobian.dtype)
        return jacobian

    def derivatives(
        self, u: Float[Array, " n"], p: Float[Array, ""], parameters_at: Callable
    ) -> tuple[Float[Array, "n n+1"], Float[Array, "k k"]]:
        """Derivative of the residual by u and the parameter, and `linearisation`.

        `parameters_at(p)` are the parameters with the value p of the one that varies.
        To be overridden where the two share work.
        """
        if type(self).jacobian is AbstractProblem.jacobian:
            whole = jax.jacfwd(lambda z: self.residual(z[:-1], parameters_at(z[-1])))(
                jnp.append(u, p)
            )
        else:
            _, by_p = jax.jvp(
                lambda p: self.residual(u, parameters_at(p)), (p,), (jnp.ones_like(p),)
            )
            by_u = self.jacobian(u, parameters_at(p))
            whole = jnp.concatenate([by_u, by_p[:, None]], axis=1)
        return whole, self.linearisation(u, parameters_at(p), whole[:, :-1])

    def motion(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        """The vector field, or the map, whose derivative is `linearisation`.

        Override it together with `linearisation`, or override `local_motion` (where
        `costly`, `local_jacobian`), or set `normal_forms` to False.
        """
        moved = self.residual(u, parameters)
        return moved + u if self.stability == "map" else moved

    def local_motion(
        self, u: Float[Array, " n"], parameters: PyTree
    ) -> tuple[Callable[[Float[Array, " k"]], Float[Array, " k"]], Float[Array, " k"]]:
        """The vector field or map around a solution, and the point where it is there.

        Normal-form coefficients come from its first three derivatives; its eigenvalues
        must be those of `linearisation`, and any number of others off the imaginary
        axis or the unit circle. By default `motion`.
        """
        return lambda y: self.motion(y, parameters), u

    def local_jacobian(
        self, u: Float[Array, " n"], parameters: PyTree
    ) -> tuple[Callable[[Float[Array, " k"]], Float[Array, "k k"]], Float[Array, " k"]]:
        """The Jacobian of `local_motion` as a function, and the point where it is.

        Where `costly`, normal-form coefficients come from central differences of this,
        and `local_motion` is not asked for.
        """
        motion, y = self.local_motion(u, parameters)
        return jax.jacfwd(motion), y

    @property
    def normal_forms(self) -> bool:
        """Whether `local_motion` can be differentiated three times."""
        return True

    def monitor(
        self, u: Float[Array, " n"], parameters: PyTree
    ) -> dict[str, Float[Array, ""]]:
        """Values of the test functions that `monitors` names."""
        del u, parameters
        return {}

    def monitors(self) -> Mapping[str, Monitor]:
        """Test functions of this problem by name; may depend on its structure only."""
        return {}

    def vanishing_with(self, name: str) -> tuple[str, ...]:
        """Monitors that are zero wherever this one is, and say nothing more there."""
        del name
        return ()

    def observe(self, u: Float[Array, " n"], parameters: PyTree) -> dict[str, Array]:
        """Further quantities to keep with each point (`point.observed`)."""
        del u, parameters
        return {}

    def watched(
        self, name: str, u: Float[Array, " n"], parameters: PyTree
    ) -> Float[Array, ""]:
        """One of the monitors alone, where that is less work."""
        return self.monitor(u, parameters)[name]

    def watched_by_number(
        self, number: Int[Array, ""], u: Float[Array, " n"], parameters: PyTree
    ) -> Float[Array, ""]:
        """One of the monitors alone, by its place in `monitors`.

        To be overridden where one program is to find the zeros of all of them.
        """
        values = self.monitor(u, parameters)
        return jnp.stack([values[name] for name in self.monitors()])[number]

    def seen(
        self, u: Float[Array, " n"], parameters: PyTree
    ) -> tuple[dict[str, Array], dict[str, Array]]:
        """`monitor` and `observe` together, where they share work."""
        return self.monitor(u, parameters), self.observe(u, parameters)

    def scale(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        """(n,) sizes of the components of u, by which lengths along a branch are
        measured. By default 1, or the root mean square of u where that is more."""
        del parameters
        size = jnp.maximum(1.0, jnp.sqrt(jnp.mean(u * u)))
        return jnp.broadcast_to(size, u.shape)

    @property
    def costly(self) -> bool:
        """Whether second derivatives of `residual` take long to compile, so that its
        special points are better enclosed than solved for."""
        return False

    @property
    def detects(self) -> bool:
        """Whether folds, branch points and those of `stability` are sought."""
        return True

    def free(self, u: np.ndarray) -> tuple[float, ...]:
        """Parameters that are unknowns of this problem (curves in two parameters)."""
        del u
        return ()

    def limits(self) -> Mapping[int, tuple[float, float]]:
        """Bounds on components of u, by index; a branch ends exactly on them."""
        return {}

    def check(self, point: Any) -> str | None:
        """None where the point is admissible, else the reason why not, in words."""
        del point
        return None

    def transition(self, point: Any) -> Start | None:
        """How to go on behind the zero `point` of a monitor that ends this problem.

        A `Start` with another problem (same `parameters`), or None to end the branch.
        """
        del point
        return None

    def refreshed(self, u: np.ndarray, parameters: PyTree) -> "AbstractProblem":
        """The same problem with its internal references (borders, phase conditions)
        taken from this point. Must depend on the point only, not on the way there, so
        that a branch taken up again is the identical branch; only signs may be chosen
        by those before, and must be, where test functions depend on them. Structure and
        shapes stay.
        """
        del u, parameters
        return self

    def doubled(self, point: Any, direction: np.ndarray) -> Start | None:
        """The doubled orbit at a flip: a problem whose solutions include this orbit run
        through twice, its state there, and the tangent (direction of the eigenvector of
        -1, parameter component 0). None where there is none."""
        del point, direction
        return None

    def cycle(self, point: Any, matrix: np.ndarray) -> Start | None:
        """The limit cycle born at a Hopf point, whose linearisation is `matrix`."""
        del point, matrix
        return None

    def eigenvalues(
        self, u: np.ndarray, parameters: PyTree, at: Any
    ) -> tuple[Any, str]:
        """Eigenvalues of `at.linearisation`, (k,) complex, the largest modulus first,
        and what is to be known of them, else the empty string.

        To be overridden where the matrix is unbounded at some points, with the limits.
        """
        del u, parameters
        return eigenvalues_of(at.linearisation), ""

    def copies(
        self, u: np.ndarray, tangent: np.ndarray
    ) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """All ways to write this solution down, the first of them as it is: family,
        state and tangent (both (n,)). A periodic orbit has several, which begin at
        different points of it. A branch that meets any of them again is closed.
        """
        return [(self.family, u, tangent)]

    def brought_near(
        self, states: Float[np.ndarray, "k n"], u: np.ndarray
    ) -> Float[np.ndarray, "k n"]:
        """The same solutions, written down as near `u` as can be: phases and angles
        may differ by whole turns."""
        del u
        return states

    @property
    def family(self) -> str:
        """Problems of one family have the same solutions, as states of one form."""
        return self.signature

    def half_away(self, u: np.ndarray, parameters: PyTree) -> float | None:
        """How far a periodic orbit is from one of half the period run through twice,
        in lengths of steps; None where the problem has no such solutions."""
        del u, parameters
        return None

    @property
    def signature(self) -> str:
        """What is not array about this problem, as text; saved with every point."""
        return ""

    def with_signature(self, signature: str) -> "AbstractProblem":
        """The problem that has this signature, to take up a saved branch."""
        if signature != self.signature:
            raise ValueError(
                f"the saved branch has signature {signature!r}, this problem "
                f"{self.signature!r}; take it up with the problem it was made with"
            )
        return self
