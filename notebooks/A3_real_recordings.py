# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # A3. What do textbook models lack? Five sets of real recordings
#
# The recordings show the motion of a pendulum, falling balls, a marble that bounces on
# paper, a positioning stage, and a mounting head that places components. Each system
# has a textbook model of a few lines, and `diagnose` determines what this model lacks.
# (Notebook A4 tests how well the completed models predict another recording in free
# runs.) Every model specifies its parameters, its sensor and the noise of the sensor,
# and the terms come from one library. Terms that a model already contains, or that
# cannot occur, are excluded. The models that A4 also needs are in
# `textbook_models.py`.
#
# Four of the data sets are public; the marble is from a student project. The package
# contains only the recordings of the pendulum, reduced to every tenth sample
# (`jaxcam.data.PENDULUM`):
#
# - `pendulum`: github.com/dynamicslab/MultiArm-Pendulum (MIT), arXiv:2205.06231;
# - `ball_drop`: github.com/briandesilva/discovery-of-physics-from-data (MIT);
# - `bouncing_marble`: tracks from a student project (XS06), without a licence;
# - `positioning_stage`: the EMPS benchmark, www.nonlinearbenchmark.org;
# - `mounting_head`: Juloski, Heemels and Ferrari-Trecate 2004, without a licence.
#
# Put these five folders into a folder `real`, and set the environment variable
# `JAXCAM_RECORDINGS` to the folder that contains `real`. Without the recordings, this
# notebook prints a message and stops.

# +
import dataclasses
import os
import sys
import time
from pathlib import Path

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from textbook_models import (
    cart,
    head,
    hinge,
    pendulum,
    read_head,
    read_stage,
    read_swings,
    slower,
    spring,
    stage,
)

import jaxcam
from jaxcam.discrepancy import diagnose, Diagnosis, library
from jaxcam.fitting import fit, held_out_cost, Parameter, Sensor
from jaxcam.plotting import style
from jaxcam.recordings import read_case, Recording, References, segment


# this takes half an hour, so it runs only if the recordings are there
folder = Path(os.environ.get("JAXCAM_RECORDINGS", ".")) / "real"
if not folder.is_dir():
    print(
        "Skipped: download the data sets listed in this notebook, and set "
        "JAXCAM_RECORDINGS to the folder that contains `real`."
    )
    sys.exit()

found: dict[str, Diagnosis] = {}
moved: dict[str, tuple[float, float]] = {}


def terms(*without: str, center: float = References.spring_center, **options):
    """Return the library without terms that the model includes or that cannot occur.

    External vibration is omitted: the recordings do not share a time origin, so a
    vibration would not have the same phase in two of them.
    """
    forms = References(spring_center=center)
    every = library(turned=False, references=forms, **options)
    return [t for t in every if t.name not in ("external_vibration", *without)]


def transferred(result: Diagnosis) -> tuple[float, float]:
    """Return the rms residuals of the last recording, predicted from the others.

    The first value is without the added terms, the second with them.
    """
    rms = []
    for trial in (result.before, result.after):
        problem = trial.problem
        *seen, unseen = problem.records
        known = fit(problem, free=trial.free, start=trial, weights=problem.only(seen))
        weights = problem.only([unseen])
        samples = np.asarray(problem.pieces.flown.known)[len(seen)].sum()
        cost = held_out_cost(problem, known, weights)
        rms.append(float(np.sqrt(cost / samples)) * result.noise_floor)
    return rms[0], rms[1]


def ask(case: str, system, runs, **options) -> None:
    """Diagnose one data set and print the result."""
    began, used = time.time(), time.process_time()
    result = diagnose(system, runs, case=case, **options)
    found[case] = result
    moved[case] = transferred(result) if len(runs) > 1 else (np.nan, np.nan)
    print(result)
    for name, one in result.rig.items():
        print(f"    {name} = {one.value:.5g} +- {one.stderr:.2g}")
    for other in result.alternatives[:3]:
        print(f"    {other.name} was not named: {other.reason}")
    for caveat in result.caveats:
        print(f"    caveat: {caveat}")
    print(
        f"    held-out rms {result.heldout_before:.3g} -> {result.heldout_after:.3g}, "
        f"last recording {moved[case][0]:.3g} -> {moved[case][1]:.3g}, "
        f"noise {result.noise_floor:.3g}"
    )
    left = [one for one in result.left_after if one.significant][:2]
    for one in left:
        print(f"    still unexplained: {one.sentence}, {one.place}")
    print(
        f"    {time.time() - began:.0f} s, {time.process_time() - used:.0f} s of CPU",
        flush=True,
    )


# -

# ## A pendulum
#
# An encoder recorded two swings, which start at 93 and at 4 degrees. The model is a
# rigid pendulum with viscous friction in the hinge.

# +
ask(
    "pendulum",
    pendulum.system,
    read_swings(folder),
    # the model already has these terms
    candidates=terms("viscous_damping", "sensor_offset", center=0.0),
    sensors=pendulum.sensors,
    parameters=hinge,
)
# -

# ## Falling balls
#
# Five balls were each dropped twice from a bridge and filmed at 15 frames per second.
# Gravity is known, so the model has no parameters. The noise of a film is not specified
# anywhere; it is estimated from the scatter about a polynomial of degree 5 fitted to
# each drop, and one value is used for all balls. In the first samples, the hand still
# holds the ball, so the first tenth of the drop height is omitted. Terms for dry
# friction, springs and hinges are excluded, because a ball in the air has none.


# +
class FallingBody(jaxcam.HybridSystem):
    """Free fall: height (m) and velocity (m/s)."""

    gravity: float = 9.81

    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.gravity])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return state


def scatter(time, samples, degree: int) -> float:
    """Return the standard deviation about a fitted polynomial."""
    smooth = np.polynomial.Polynomial.fit(time, samples, degree)
    freedom = len(time) - degree - 1
    return float(np.sqrt(np.sum((samples - smooth(time)) ** 2) / freedom))


def falling(run: Recording) -> Recording:
    """Return the recording without the first tenth of the height of fall."""
    height = run["height_m"]
    first = np.argmax(height < height[0] - 0.1 * np.ptp(height))
    clock = run.time[first:] - run.time[first]
    return Recording(run.name, clock, {"height_m": height[first:]})


solid = (
    "coulomb_friction",
    "stribeck_friction",
    "asymmetric_friction",
    "nonlinear_spring",
    "gravity_imbalance",
)
case = read_case(folder / "ball_drop", channels=("height_m",), split="drop")
drops = [falling(run) for run in case]
noise = float(np.sqrt(np.mean([scatter(r.time, r["height_m"], 5) ** 2 for r in drops])))
for ball in sorted({run.name.rsplit("_drop", 1)[0] for run in drops}):
    both = [run for run in drops if run.name.startswith(ball)]
    ask(
        ball,
        FallingBody(),
        [segment(run, "height_m", noise=noise) for run in both],
        candidates=terms(*solid),
        sensors={"height_m": Sensor(0, noise=noise)},
    )
# -

# ## A marble on paper
#
# A glass marble falls onto stacks of 1 to 100 sheets of paper and is tracked at 200
# frames per second. A pixel corresponds to 0.799 mm, a value known to a few per cent
# from the free fall, and the centre of the marble is known to a quarter of a pixel. The
# track is followed from frame to frame; drops in which the marble is lost are omitted.
# The hand disturbs the beginning of the first arc, so the first tenth of the drop
# height is omitted. The end of the track, where the bounces are too low to be
# distinguished, and the samples at rest after it are also omitted.


# +
class Bouncing(jaxcam.HybridSystem):
    """A ball above a floor, with constant restitution: height (m), velocity (m/s)."""

    coefficient: float = 0.5
    gravity: float = 9.81

    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.gravity])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.coefficient * state[1]])


pixel = 0.799e-3


def tracked(file: Path):
    """Return times (s) and heights (pixels, downwards) of the first object found."""
    frames: list[float] = []
    points: list[np.ndarray] = []
    for line in file.read_text().splitlines()[2:]:
        if not line[:1].isdigit():
            break  # a summary follows the tracks
        frame, *numbers = (float(x) for x in line.split() if x != "*")
        pairs = np.reshape(numbers[: len(numbers) // 2 * 2], (-1, 2))
        if not len(pairs):
            continue
        near = 0
        if points:
            ahead = 2 * points[-1] - points[-2] if len(points) > 1 else points[-1]
            away = np.hypot(*(pairs - ahead).T)
            near = int(np.argmin(away))
            if away[near] > 60:
                continue
        frames.append(frame)
        points.append(pairs[near])
    return np.array(frames) / 200, np.array(points)[:, 1]


def drop(file: Path) -> Recording:
    """Return the heights above the stack (m), from the release to the rest."""
    clock, down = tracked(file)
    low = down > np.mean([down.min(), down.max()])
    still = [k for k in np.flatnonzero(low) if np.ptp(down[k : k + 20]) < 4]
    level = np.median(down[still[0] : still[0] + 20])
    first = np.argmax(down > down[0] + (level - down[0]) / 10)
    part = slice(first, still[0] + 20)
    height = (level - down[part]) * pixel
    return Recording(file.stem, clock[part] - clock[first], {"height_m": height})


def arcs(run: Recording):
    """Divide one drop into arcs at its impacts."""
    cut = segment(run, "height_m", np.zeros(len(run)), noise=pixel / 4)
    flights = tuple(part for part in cut.flights if part.stop.kind == "impact")
    return dataclasses.replace(cut, flights=flights, contacts=())


for sheets in ("001", "008", "016", "100"):
    files = sorted((folder / "bouncing_marble").glob(f"sheets{sheets}_*.tsv"))
    whole = [run for run in map(drop, files) if np.diff(run.time).max() < 1.5 / 200]
    ask(
        f"marble on {int(sheets)}",
        Bouncing(),
        [arcs(run) for run in whole],
        candidates=terms("sensor_offset", *solid),
        sensors={"height_m": Sensor(0, noise=pixel / 4)},
        parameters=[
            Parameter("restitution", lambda m: m.system.coefficient, scale=0.01),
            Parameter("gravity", lambda m: m.system.gravity, tolerance=0.5),
            # the marble moves slightly towards or away from the camera
            Parameter(
                "level",
                lambda m: m.sensors["height_m"].offset,
                tolerance=0.005,
                per_record=True,
            ),
        ],
    )
# -

# ## A positioning stage
#
# A motor moves a load through a screw; the force is the input and the position is the
# output (the EMPS benchmark). The model is a mass with viscous friction. The measured
# force is held constant from each sample to the next. Each group of four samples is
# reduced to one: the first position and the mean force.

# +
ask(
    "positioning stage",
    stage.system,
    [
        segment(
            slower(run, "position_m", "motor_force_N", 4),
            "position_m",
            noise=stage.sensors["position_m"].noise,
        )
        for run in read_stage(folder)
    ],
    candidates=terms("viscous_damping", center=0.125, clocked=True),
    sensors=stage.sensors,
    parameters=cart,
    drive=stage.drive,
)
# -

# ## A mounting head
#
# A head that places components on a board is driven by a motor; the voltage is the
# input and the position is the output. The model is a mass with a spring and a damper.
# The head touches the board at an unknown position. There is only one recording; its
# two halves are used as two recordings, and the extended library is tried.

# +
_, *halves = read_head(folder)
ask(
    "mounting head",
    head.system,
    [segment(half, "position_m", noise=5e-6) for half in halves],
    candidates=terms("viscous_damping", clocked=True, extended=True),
    sensors=head.sensors,
    parameters=spring,
    drive=head.drive,
)
# -

# ## All recordings
#
# The figure shows the residuals on held-out data in units of the noise, with the
# textbook model (open circles) and with the diagnosed model (filled circles).

# +
with style():
    figure, axes = plt.subplots(figsize=(10, 4))
for row, result in enumerate(found.values()):
    before = result.heldout_before / result.noise_floor
    after = result.heldout_after / result.noise_floor
    axes.plot([before, after], [row, row], color="0.8", zorder=1)
    axes.plot(before, row, "o", color="C0", fillstyle="none")
    axes.plot(after, row, "o", color="C0")
    names = ", ".join(name.replace("_", " ") for name in result.names) or "nothing"
    axes.text(1.02, row, names, transform=axes.get_yaxis_transform(), va="center")
axes.axvline(1.0, color="0.5", linewidth=0.8)
axes.set_yticks(range(len(found)), list(found))
axes.set_xscale("log")
axes.set_xlabel("residual on held-out data (times the noise)")
axes.invert_yaxis()
if __name__ == "__main__":
    plt.show()
# -
