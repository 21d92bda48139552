"""Measure how often the 95 % intervals contain the true values.

Rigs are drawn at random from the tolerance box, simulated by a scalar Runge-Kutta loop
that shares no code with the fit, recorded through noisy encoders at three noise levels,
cut, and fitted. The script prints, for each level and parameter, the fraction of
intervals that contain the true value, and the mean (bias) and spread of the errors in
standard errors; it also prints the residuals. The estimates of parameters that the data
do not determine depend on the tolerances, so only another rig is an independent case:
many rigs are more informative than many noise realizations.

The bias has two parts: one from the choice of rigs, which a linear model without noise
would also have, and the rest, which is due to the fit. Both are printed with their
standard errors, from the scatter between rigs, since fits of one rig are not
independent.

`--mirror` fits every rig together with its mirror image about the nominal values, and
every noise realization with its negative. Both are equally likely, so the expected
error is unchanged, while everything linear in tolerances and noise cancels: the bias is
then known several times more accurately than from the same number of independent fits.

`--truth normal` draws the rigs from the Gaussian that represents a tolerance in the
fit; the difference from `box` is the effect of the box shape. `--profile` checks for
some parameters whether the profile-likelihood interval contains the true value. The
last line is the fraction of cases in which all parameters together are inside the 95 %
ellipsoid, and inside the region bounded by the cost itself.

    python benchmarks/coverage.py --rigs 20 --draws 5
    python benchmarks/coverage.py --rigs 100 --draws 1 --levels 1
    python benchmarks/coverage.py --rigs 40 --draws 1 --levels 1 --mirror
"""

import argparse
import dataclasses
import math
import sys
import time

import numpy as np
import scipy.stats

import jaxcam  # noqa: F401  64-bit floats
from jaxcam import fitting
from jaxcam.data import DEMO_RIG
from jaxcam.data.make_demo import measure, RealRig, simulate_rig, Truth
from jaxcam.recordings import read_rig, Recording, segment_case


LEVELS = (0.5, 1.0, 2.0)
DURATION, SETTLE = 2.0, 6.0


class Mirrored:
    """The random numbers of a generator, mirrored about their mean."""

    def __init__(self, seed):
        self._rng = np.random.default_rng(seed)

    def uniform(self, low, high):
        return low + high - self._rng.uniform(low, high)

    def normal(self):
        return -self._rng.normal()

    def standard_normal(self, size):
        return -self._rng.standard_normal(size)


def both_sides(rng, mirror: bool):
    """A separate generator and, with `mirror`, a second one that mirrors it."""
    seed = int(rng.integers(2**62))
    first = np.random.default_rng(seed)
    return [first, Mirrored(seed)] if mirror else [first]


def random_rig(nominal, rng, shape: str = "box") -> RealRig:
    """A random rig within the tolerances, without hinge friction."""

    def draw(quantity):
        if shape == "normal":
            return quantity.value + quantity.tolerance / math.sqrt(3) * rng.normal()
        return quantity.value + quantity.tolerance * rng.uniform(-1, 1)

    height = draw(nominal.cam_radius) + draw(nominal.follower_half_height)
    return RealRig(
        height=height,
        eccentricity=draw(nominal.cam_eccentricity),
        center_x=draw(nominal.cam_center_x),
        center_y=draw(nominal.cam_center_y),
        half_height=draw(nominal.follower_half_height),
        stiffness_over_inertia=draw(nominal.spring_stiffness) / nominal.inertia.value,
        spring_hook_x=draw(nominal.spring_hook_x),
        spring_elongation=draw(nominal.spring_elongation),
        restitution=draw(nominal.restitution),
        damping=0.0,
    )


def true_values(real: RealRig, nominal) -> dict[str, float]:
    return {
        "stiffness": real.stiffness_over_inertia * nominal.inertia.value,
        "spring_hook_x": real.spring_hook_x,
        "spring_elongation": real.spring_elongation,
        "spring_half_height": real.half_height,
        "cam_radius": real.height - nominal.follower_half_height.value,
        "cam_eccentricity": real.eccentricity,
        "cam_center_x": real.center_x,
        "cam_center_y": real.center_y,
        "restitution": real.restitution,
    }


def recording(truth: Truth, sensors, name: str, rng) -> Recording:
    turned = truth.turned - 2 * np.pi * np.floor(truth.turned[0] / (2 * np.pi))
    channels = {
        "cam_angle_rad": measure(
            turned, sensors.cam_noise, sensors.cam_counts_per_turn, rng
        ),
        "follower_angle_rad": measure(
            truth.angle, sensors.follower_noise, sensors.follower_counts_per_turn, rng
        ),
    }
    return Recording(name, truth.time, channels)


@dataclasses.dataclass(frozen=True)
class Case:
    """One fit; `off` contains the errors and standard errors, `held` the cost with a
    parameter held at its true value.

    Cases of one `group` share a rig; groups are independent. `drawn` is the error due
    to the tolerances alone: if the data carry no information about a parameter, its
    estimate stays at the nominal value for every rig.
    """

    group: int
    converged: bool
    off: dict[str, tuple[float, float]]
    rms: float
    white: float
    distance: float
    excess: float
    drawn: dict[str, float]
    held: dict[str, float]


def at_level(nominal, level: float):
    """The rig file with another noise level; the encoder counts are unchanged."""
    sensors = dataclasses.replace(
        nominal.sensors,
        follower_noise=level * nominal.sensors.follower_noise,
        cam_noise=level * nominal.sensors.cam_noise,
    )
    return dataclasses.replace(nominal, sensors=sensors)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rigs", type=int, default=20)
    parser.add_argument("--draws", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--levels", type=float, nargs="*", default=LEVELS)
    parser.add_argument("--truth", choices=("box", "normal"), default="box")
    parser.add_argument("--profile", nargs="*", default=[], metavar="PARAMETER")
    parser.add_argument("--mirror", action="store_true")
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    nominal = read_rig(DEMO_RIG / "rig.toml")
    found: dict[float, list] = {level: [] for level in options.levels}
    begun, cpu = time.time(), time.process_time()
    for number in range(options.rigs):
        speeds = [
            rng.uniform(*span) * math.pi / 30 for span in ((130, 148), (150, 175))
        ]
        for side in both_sides(rng, options.mirror):
            real = random_rig(nominal, side, options.truth)
            truths = [simulate_rig(real, w, DURATION, settle=SETTLE) for w in speeds]
            truth = true_values(real, nominal)
            for level in options.levels:
                rig = at_level(nominal, level)
                for _ in range(options.draws):
                    found[level] += [
                        one_case(number, rig, truths, truth, noise, options.profile)
                        for noise in both_sides(rng, options.mirror)
                    ]
        print(
            f"{number + 1} rigs, {time.time() - begun:.0f} s "
            f"({time.process_time() - cpu:.0f} s of CPU)",
            file=sys.stderr,
            flush=True,
        )
        report(found)


def one_case(group, rig, truths, truth, rng, profiled) -> Case:
    """Record, cut and fit the runs of one rig."""
    runs = [
        recording(one, rig.sensors, f"run{k}", rng)
        for k, one in enumerate(truths, start=1)
    ]
    problem = fitting.Problem.build(
        fitting.cam_follower_model(rig),
        segment_case(runs, rig),
        fitting.cam_follower_parameters(rig),
    )
    fit = fitting.fit(problem)
    left = fitting.residuals(fit)
    return Case(
        group=group,
        converged=fit.converged,
        off={e.name: (e.value - truth[e.name], e.stderr) for e in fit.estimates},
        rms=math.sqrt(np.mean([(p.rms / p.noise) ** 2 for p in left])),
        white=max(abs(p.autocorrelation(1)[0]) for p in left),
        distance=distance(fit, truth),
        excess=fitting.excess_cost(fit, truth),
        drawn=drawn_error(fit, truth),
        held={
            name: fitting.profile(fit, name, values=[truth[name]]).cost[0]
            for name in profiled
        },
    )


def mean_and_error(values, groups) -> tuple[float, float]:
    """Mean, and its standard error from the scatter of the means of the groups."""
    _, which, count = np.unique(groups, return_inverse=True, return_counts=True)
    means = np.bincount(which, values) / count
    if len(means) < 2:
        return float(np.mean(means)), math.nan
    return float(np.mean(means)), float(np.std(means, ddof=1) / math.sqrt(len(means)))


def distance(fit, truth) -> float:
    """Chi-square of all parameters together, with as many degrees of freedom."""
    # in standard errors: otherwise parameters of small magnitude would be lost
    z = np.array([(e.value - truth[e.name]) / e.stderr for e in fit.estimates])
    return float(z @ np.linalg.solve(fit.correlation, z))


def drawn_error(fit, truth) -> dict[str, float]:
    """Error of a linear model without noise: C P (nominal - truth), with the covariance
    C and the information P of the tolerances.
    """
    names = [e.name for e in fit.estimates]
    problem = fit.problem
    start = dict(zip(problem.names, np.asarray(problem.start.values[0])))
    off = np.array([start[name] - truth[name] for name in names])
    known = np.array([problem.parameter(name).prior_stderr for name in names]) ** -2
    return dict(zip(names, (fit.covariance @ (known * off)).tolist()))


def report(found) -> None:
    for level, cases in found.items():
        if not cases:
            continue
        converged = sum(case.converged for case in cases)
        rms = np.mean([case.rms for case in cases])
        white = np.mean([case.white for case in cases])
        print(
            f"\nnoise x {level:g}: {len(cases)} fits, {converged} converged; residuals "
            f"{rms:.3f} times the noise, lag-one correlation {white:.3f}"
        )
        print("| parameter | coverage | bias | spread | bias of the fit | profile |")
        print("| --- | --- | --- | --- | --- | --- |")
        for name in cases[0].off:
            z = np.array([case.off[name][0] / case.off[name][1] for case in cases])
            inside = np.mean(np.abs(z) < 1.96)
            drawn = np.array([case.drawn[name] / case.off[name][1] for case in cases])
            groups = [case.group for case in cases]
            bias, bias_error = mean_and_error(z, groups)
            # the remainder comes from the noise and the nonlinearity of the model
            rest, rest_error = mean_and_error(z - drawn, groups)
            held = ""
            if name in cases[0].held:
                level_95 = scipy.stats.chi2.ppf(0.95, 1)
                held = f"{np.mean([case.held[name] < level_95 for case in cases]):.0%}"
            print(
                f"| {name} | {inside:.0%} | {bias:+.2f} ± {bias_error:.2f} | "
                f"{np.std(z):.2f} | {rest:+.3f} ± {rest_error:.3f} | {held} |"
            )
        limit = scipy.stats.chi2.ppf(0.95, len(cases[0].off))
        together = np.mean([case.distance < limit for case in cases])
        middle = np.median([case.distance for case in cases])
        by_cost = np.mean([case.excess < limit for case in cases])
        excess = np.median([case.excess for case in cases])
        print(
            f"all together: {together:.0%} inside the ellipsoid, median chi-square "
            f"{middle:.1f} of {len(cases[0].off)} degrees; {by_cost:.0%} inside by "
            f"the cost, median {excess:.1f}"
        )
    sys.stdout.flush()


if __name__ == "__main__":
    main()
