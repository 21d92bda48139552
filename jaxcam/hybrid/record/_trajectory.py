"""The result of a simulation: impacts, contacts, and the state at any time."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...tables import ShortTable
from .._settings import Settings
from .._system import HybridSystem
from ..checks import refuse_tracers
from ..codes import message
from ..programs import is_traced, is_tracing, program
from ..surface import gaps
from ._events import Contacts, Impacts, Steps, Switches
from ._modes import Modes, modes_of
from ._printed import Printed
from ._sample import pad, sample, sample_known
from ._section import crossings


class Trajectory(Printed):
    """A trajectory of a hybrid system on [t0, t1].

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> trajectory = jaxcam.simulate(BouncingBall(), [1.0, 0.0], 0.0, 1.0)
        >>> np.asarray(trajectory.at([0.0, 0.4])).round(4).tolist()
        [[1.0, 0.0], [0.2152, -3.924]]
    """

    system: HybridSystem
    """The simulated system."""
    settings: Settings
    """Accuracy settings of the run."""
    t0: Float[Array, ""]
    """Start time (s)."""
    t1: Float[Array, ""]
    """Requested end time (s)."""
    impacts: Impacts
    """The impacts, in order."""
    contacts: Contacts
    """The intervals of sustained contact."""
    steps: Steps
    """The integration points."""
    code: Int[Array, ""]
    """Index into `RESULTS`: 0 if the run reached t1."""
    switches: Switches | None = None
    """The events at switching surfaces; `None` for a system without such surfaces."""

    def _batched(self) -> bool:
        return np.ndim(self.code) > 0

    def _table(self) -> ShortTable:
        end = float(np.asarray(self.steps.time)[int(self.steps.count) - 1])
        said = (
            f"{type(self.system).__name__} from {float(self.t0):g} to {end:g} s, "
            f"impacts: {int(self.impacts.count)}, contacts: {int(self.contacts.count)}"
        )
        if self.switches is not None:
            said = f"{said}, switches: {int(self.switches.count)}"
        said = f"{said}. {self.result}" if self.result else said
        return ShortTable(said, (), ())

    @property
    def successful(self):
        """Return whether the trajectory reached t1."""
        return self.code == 0

    @property
    def result(self) -> str:
        """The reason why the run did not reach t1; empty if it did."""
        return message(int(self.code))

    @property
    def final(self) -> Float[Array, " n"]:
        """State at the end of the run, shape `(n,)`; NaN under a transformation if the
        run failed.
        """
        if not is_traced(self):
            last = np.asarray(self.steps.state)[int(self.steps.count) - 1]
            return jax.device_put(last)
        last = self.steps.state[self.steps.count - 1]
        return jnp.where(self.code == 0, last, jnp.nan)

    def at(self, times) -> Float[Array, "times n"]:
        """Return the state at each of `times`, after any impact at that time.

        Each sample is computed by one additional step of the same method from the last
        point before it, so it is differentiable and as accurate as the run itself.

        Args:
            times: Times (s), shape `(times,)`.

        Returns:
            States, shape `(times, n)`.

        Raises:
            ValueError: `times` is not a vector, or a time is outside [t0, t1].
        """
        known = not (is_traced((self, times)) or is_tracing())
        # in numpy if possible, because jax would compile a program for every new length
        xp = np if known else jnp
        times = xp.asarray(times, dtype=xp.float64)
        if times.ndim != 1:
            raise ValueError(
                f"times has shape {times.shape}; pass a vector, such as "
                "jnp.linspace(t0, t1, 100) or jnp.array([t])"
            )
        if known and times.size:
            low, high = float(times.min()), float(times.max())
            end = float(np.asarray(self.steps.time)[int(self.steps.count) - 1])
            room = 1e-12 * max(abs(float(self.t0)), abs(end))
            if not (low >= float(self.t0) - room and high <= end + room):
                raise ValueError(
                    f"times extend from {low:g} to {high:g} s, but the trajectory "
                    f"covers {float(self.t0):g} to {end:g} s"
                )
        if not known:
            return sample(self.system, self.settings, self.steps, times)
        found = sample_known(self.system, self.settings, self.steps, times)
        return jax.device_put(found)

    def gap(self, times):
        """Return the gap at each of `times`.

        Args:
            times: Times (s), shape `(times,)`.

        Returns:
            Gaps, shape `(times,)`, or `(times, m)` for m > 1 constraints.

        Examples:
            >>> from jaxcam.models import BouncingBall
            >>> trajectory = jaxcam.simulate(BouncingBall(), [1.0, 0.0], 0.0, 1.0)
            >>> gaps = trajectory.gap([0.0, 0.2])
            >>> np.asarray(gaps).round(4).tolist()  # 1 - g t^2 / 2
            [1.0, 0.8038]
        """
        states = self.at(times)
        if is_traced((self, times)) or is_tracing():
            return _gaps(self.system, jnp.asarray(times, dtype=jnp.float64), states)
        times, states = np.asarray(times), np.asarray(states)
        found = _gaps(self.system, pad(times, np.nan), pad(states, np.nan))
        return jax.device_put(np.asarray(found)[: len(times)].copy())

    def sliding(self, surface: int = 0) -> Float[Array, "intervals 2"]:
        """Return the intervals in which the motion slides along a switching surface;
        with dry friction, the body sticks.

        Args:
            surface: Index of the surface.

        Returns:
            Start and end of each interval (s), shape `(intervals, 2)`. An interval that
                lasts beyond the run ends at the end of the run.

        Raises:
            ValueError: The system has no such surface.

        Examples:
            >>> from jaxcam.models import BeltOscillator
            >>> run = jaxcam.simulate(BeltOscillator(), [0.5, 0.2], 0.0, 5.0)
            >>> run.sliding().round(6).tolist()
            [[0.0, 2.5]]
        """
        refuse_tracers("sliding", "trajectory.steps.sides", self)
        count = int(self.steps.count)
        sides = np.zeros((count, 0)) if self.steps.sides is None else self.steps.sides
        sides = np.asarray(sides)[:count]
        if not 0 <= surface < sides.shape[1]:
            raise ValueError(
                f"surface {surface} does not exist: {type(self.system).__name__} has "
                f"{sides.shape[1]} switching surfaces, counted from 0"
            )
        time, slides = np.asarray(self.steps.time)[:count], sides[:, surface] == 0
        # the last point only ends an interval
        slides[-1] = False
        earlier = np.append(False, slides[:-1])
        found = np.stack([time[slides & ~earlier], time[~slides & earlier]], axis=1)
        return jnp.asarray(found[found[:, 1] > found[:, 0]])

    @property
    def modes(self) -> Modes:
        """Return the intervals that the motion of a hybrid automaton spends in its
        modes.

        Raises:
            ValueError: The system has no modes.

        Examples:
            >>> from jaxcam.models import SpringMassRunner
            >>> start = [0.0, 1.0, 5.0, 0.0]
            >>> run = jaxcam.simulate(SpringMassRunner(), start, 0.0, 0.4)
            >>> run.modes.names()
            ['falling', 'stance', 'rising', 'falling']
        """
        refuse_tracers("modes", "trajectory.steps.sides", self)
        return modes_of(self.system, self.steps)

    def stroboscopic(self, period=None, phase=0.0) -> Float[Array, "k n"]:
        """Return the states at the times `t0 + phase + i * period`, i = 0, 1, ...

        Args:
            period: Sampling period (s); default: that of the forcing.
            phase: Time of the first sample after t0 (s).

        Returns:
            States, shape `(k, n)`.

        Raises:
            ValueError: The system has no period and none is given.

        Examples:
            >>> from jaxcam.models import BouncingBall
            >>> trajectory = jaxcam.simulate(BouncingBall(), [1.0, 0.0], 0.0, 1.0)
            >>> np.asarray(trajectory.stroboscopic(0.2)[:, 0]).round(4).tolist()
            [1.0, 0.8038, 0.2152, 0.418, 0.6392, 0.468]
        """
        refuse_tracers("stroboscopic", "trajectory.at(times)", self, period, phase)
        period = self.system.period if period is None else period
        if period is None:
            raise ValueError(
                "this system has no forcing period; pass one: stroboscopic(period=...)"
            )
        start, end = float(self.t0) + float(phase), float(self.t1)
        number = int((end - start) / float(period) * (1 + 1e-12)) + 1
        times = start + np.arange(number) * float(period)
        return self.at(np.minimum(times, end))

    def section(self, function, direction: int = 0):
        """Return the crossings of a Poincaré section `function(t, state) = 0`.

        Each integration step is searched in eight pieces; two crossings within one
        piece are missed.

        Args:
            function: A smooth scalar function of time and state.
            direction: Direction of the crossings to return: +1 rising, -1 falling, 0
                both.

        Returns:
            Times (s) and states, shapes `(k,)` and `(k, n)`.

        Examples:
            >>> from jaxcam.models import BouncingBall
            >>> trajectory = jaxcam.simulate(BouncingBall(), [1.0, 0.0], 0.0, 1.0)
            >>> times, states = trajectory.section(lambda t, x: x[1], direction=-1)
            >>> np.asarray(times).round(4).tolist()  # top: (1 + r) sqrt(2 h / g)
            [0.8127]
            >>> np.asarray(states[:, 0]).round(4).tolist()  # r^2 h
            [0.64]
        """
        refuse_tracers("section", "trajectory.at(times)", self)
        return crossings(self, function, direction)


@program
def _gaps(system, times, states):
    values = jax.vmap(lambda t, x: gaps(system, t, x))(times, states)
    return values[:, 0] if values.shape[1] == 1 else values
