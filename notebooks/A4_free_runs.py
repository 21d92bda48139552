# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # A4. How well does a model predict a recording to which it was not fitted? Free runs
#
# A model is fitted to one whole recording and then simulates another one in a free run,
# which uses only the first 20 samples and the measured input. The first line of each
# result is for the textbook model; each further line adds a term that the diagnosis in
# notebook A3 identified. The textbook models are in `textbook_models.py`.
#
# The recordings are public; A3 lists their sources. Put the folders `pendulum`,
# `positioning_stage` and `mounting_head` into a folder `real`, and set the environment
# variable `JAXCAM_RECORDINGS` to the folder that contains `real`. Without the
# recordings, this notebook prints a message and stops.

# +
import os
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from textbook_models import (
    cart,
    head,
    hinge,
    Pendulum,
    pendulum,
    read_head,
    read_stage,
    read_swings,
    spring,
    stage,
)

from jaxcam.discrepancy import with_terms
from jaxcam.fitting import fit_free_run, free_run, Model
from jaxcam.plotting import style


# this takes several minutes, so it runs only if the recordings are there
folder = Path(os.environ.get("JAXCAM_RECORDINGS", ".")) / "real"
if not folder.is_dir():
    print(
        "Skipped: download the data sets listed in notebook A3, and set "
        "JAXCAM_RECORDINGS to the folder that contains `real`."
    )
    sys.exit()

# rms errors of free runs by data set and model: fitted recording, predicted recording
strayed: dict[str, dict[str, tuple[float, float]]] = {}


def stray(case, label, model, parameters, names, seen, unseen, scales, start=None):
    """Fit a model with the named terms to one recording and simulate another one."""
    model, parameters = with_terms(model, parameters, names, scales)
    offered = {one.name for one in parameters}
    start = {name: x for name, x in (start or {}).items() if name in offered}
    fitted = fit_free_run(model, [seen], parameters, start=start)
    (channel,) = fitted.runs[0].rmse
    other = free_run(fitted.model, unseen).rmse[channel]
    pair = fitted.runs[0].rmse[channel], other
    strayed.setdefault(case, {})[label] = pair
    values = ", ".join(f"{name} {value:.4g}" for name, value in fitted.values.items())
    print(f"{case}, {label}: rms {pair[0]:.3g}, predicted {pair[1]:.3g}; {values}")
    return fitted


# -

# ## A pendulum
#
# The two swings start at 93 and at 4 degrees; the encoder reads pi when the pendulum
# hangs at rest. Each swing is predicted from the other. Dry friction and drag replace
# the viscous friction in the hinge.

# +
swings = read_swings(folder)
by_size = {"large to small": swings, "small to large": swings[::-1]}
viscous = Pendulum(stiffness=64.0)
rubbing, others = Pendulum(stiffness=64.0, damping=0.0), [hinge[0], hinge[2]]
for way, (seen, unseen) in by_size.items():
    for label, system, own, names in (
        ("textbook", viscous, hinge, ()),
        ("dry friction", rubbing, others, ("coulomb_friction",)),
        ("and drag", rubbing, others, ("coulomb_friction", "quadratic_drag")),
    ):
        swing = Model(system, pendulum.sensors)
        stray(f"pendulum, {way}", label, swing, own, names, seen, unseen, [seen])
# -

# ## A positioning stage
#
# A motor moves a load through a screw; the force is the input and the position is the
# output (the EMPS benchmark).
#
# We follow the protocol of the benchmark: the parameters are fitted to the first
# recording alone, and the second recording, which contains pulses, is then simulated in
# a free run that uses only its first 20 samples. Each line adds one term.

# +
estimation, pulses = read_stage(folder)
steps = {
    "textbook": (),
    "dry friction": ("coulomb_friction",),
    "additional damping in backward motion": ("damping_backwards",),
    "friction that depends on position": ("uneven_friction",),
}
names: tuple[str, ...] = ()
values = {"1/mass": 0.0105, "viscous": 2.0, "offset": -0.03, "fc": 0.2}
for label, more in steps.items():
    names = (*names, *more)
    fitted = stray(
        "stage", label, stage, cart, names, estimation, pulses, [estimation], values
    )
    values |= fitted.values
# -

# The free-run predictions deviate from the second recording because the friction in
# that recording is larger from the start, even before the first pulse: at the same
# position and speed, the motor force is larger in both directions. No model fitted to
# the first recording can predict this increase. Each line gives the mean magnitude of
# the motor force in the first recording and the change of the force in the second.

# +
rate = np.gradient(estimation["position_m"], estimation.time)
extra = pulses["motor_force_N"] - estimation["motor_force_N"]
for name, there in {"forwards": rate > 0.02, "backwards": rate < -0.02}.items():
    usual = np.mean(np.abs(estimation["motor_force_N"][there]))
    change = np.mean(extra[there])
    print(f"{name}: {usual:.1f} N, {change:+.2f} N in the second recording")
early = (pulses.time > 0.1) & (pulses.time < 0.3)
print(f"before the first pulse: {np.mean(extra[early]):+.2f} N")
# -

# ## A mounting head
#
# A head on a spring is driven by a motor; the voltage is the input and the position is
# the output. The head touches a board at an unknown position. There is only one
# recording, so its two halves are used.
#
# The second half is predicted from the first, and the first from the second, in free
# runs that use only the first 20 samples.

# +
run, first, second = read_head(folder)
touches = {"edge_a": 0.0105, "ka": 630.0, "la": 98.0, "ra": 0.88, "fc": 0.16}
touches |= {"edge_b": 0.0015, "kd": 2e4}
for way, (seen, unseen) in {
    "first to second": (first, second),
    "second to first": (second, first),
}.items():
    for label, names in {
        "textbook": (),
        "a surface": ("stop_above",),
        "and dry friction": ("stop_above", "coulomb_friction"),
        "and a stop at the end": ("stop_above", "coulomb_friction", "stop_below"),
    }.items():
        stray(f"head, {way}", label, head, spring, names, seen, unseen, [run], touches)
# -

# ## All recordings
#
# The figure shows the errors of the predicted recordings, relative to the errors of the
# textbook model.

# +
with style():
    figure, axes = plt.subplots(figsize=(8, 4))
for name, steps in strayed.items():
    errors = np.array([unseen for _, unseen in steps.values()])
    errors = errors / errors[0]
    axes.plot(errors, "o-")
    end = len(errors) - 1, errors[-1]
    axes.annotate(name, end, (6, 0), textcoords="offset points", va="center")
axes.set_xticks(range(4))
axes.set_xlim(-0.2, 4.2)
axes.set_yscale("log")
axes.set_xlabel("terms added")
axes.set_ylabel("error divided by that of the textbook model (–)")
if __name__ == "__main__":
    plt.show()
# -
