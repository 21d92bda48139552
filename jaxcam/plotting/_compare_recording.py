"""Plot a recording, its simulations and the residuals."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import ArrayLike
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..recordings import Recording
from ..recordings.against_model import Comparison
from ..tables import scaled
from ._axes import legend_above, several_axes
from ._channels import channel_label, name_and_unit
from ._simulated import simulated_channel
from ._style import BAND, CAM, RECORDED, styled
from .labels import labelled


Simulated: TypeAlias = ArrayLike | Comparison


@styled
def compare_recording(
    recording: Recording,
    simulated: Simulated | Mapping[str, Simulated],
    axes: Sequence[Axes] | np.ndarray | None = None,
    *,
    channel: str = "follower_angle_rad",
    contact: ArrayLike | None = None,
    noise: float | None = None,
    turns: float = 3.0,
    start: float | None = None,
) -> Figure:
    """Draw a recorded channel with its simulations, and the residuals below.

    With a channel `cam_angle_rad`, the horizontal axis is in turns of the cam;
    otherwise, it is time.

    Args:
        recording: The recording.
        simulated: The simulated channel at the samples of the recording, shape `(k,)`,
            with NaN where it was not simulated; or a comparison that contains the
            recording; or several of these, by name.
        axes: Two axes; default: a new figure.
        channel: The channel to compare.
        contact: Value of the channel in contact with the cam, shape `(k,)`, drawn as
            the surface below the motion.
        noise: Standard deviation of a sample of the channel, in its unit; drawn as a
            +-2 sigma band.
        turns: Number of turns of the cam to draw; without a cam, the entire recording
            is drawn.
        start: Start time (s); default: the first sample.

    Returns:
        The figure.

    Raises:
        ValueError: A simulation does not have the same length as the recording.

    Examples:
        >>> from jaxcam.plotting import compare_recording
        >>> from jaxcam.recordings import Recording
        >>> time = np.linspace(0, 1, 50)
        >>> run = Recording("run", time, {"angle_rad": np.sin(time)})
        >>> figure = compare_recording(run, np.sin(time) + 0.01, channel="angle_rad")
    """
    runs = dict(simulated) if isinstance(simulated, Mapping) else {"": simulated}
    runs = {name: _samples(recording, run, channel) for name, run in runs.items()}
    samples = recording[channel]
    over, keep, label = _horizontal(recording, turns, start)

    figure, grid = several_axes(
        axes, (2, 1), sharex=True, figsize=(6.4, 4.8), height_ratios=(2.2, 1)
    )
    above, below = grid[:, 0]
    if contact is not None:
        cam = _fitting(recording, contact)[keep]
        above.plot(over[keep], cam, color=CAM, linewidth=1.0, label="cam")
        floor = np.nanmin([np.nanmin(cam), samples[keep].min()])
        above.fill_between(over[keep], cam, floor, color=CAM, alpha=0.25, linewidth=0)
    # the line of the recording is wide, and pale between its edges, so that it remains
    # visible behind that of a simulation that coincides with it
    for colour, width, word in ((RECORDED, 4.8, "recorded"), (BAND, 3.4, "_inside")):
        above.plot(over[keep], samples[keep], color=colour, linewidth=width, label=word)
    left_over = {name: samples - values for name, values in runs.items()}
    kept = np.concatenate([values[keep] for values in left_over.values()])
    name, unit = name_and_unit(channel)
    factor, unit = scaled(unit, _largest(kept))
    for k, (run, values) in enumerate(runs.items()):
        above.plot(
            over[keep],
            values[keep],
            color=f"C{k}",
            linewidth=1.2,
            label=f"simulated {run}".strip(),
        )
        below.plot(
            over[keep], factor * left_over[run][keep], color=f"C{k}", linewidth=0.9
        )
    if noise is not None:
        band = 2 * factor * noise
        below.axhspan(-band, band, color=BAND, alpha=0.5, lw=0, label="noise ± 2σ")
        legend_above(below)
    below.axhline(0.0, color="black", linewidth=0.8)
    above.set_ylabel(channel_label(channel))
    below.set_ylabel(labelled("residual", unit))
    below.set_xlabel(label)
    legend_above(above)
    figure.align_ylabels([above, below])
    return figure


def _samples(recording: Recording, run: Simulated, channel: str) -> np.ndarray:
    if isinstance(run, Comparison):
        return simulated_channel(run, recording, channel)
    return _fitting(recording, run)


def _fitting(recording: Recording, values: ArrayLike) -> np.ndarray:
    array = np.asarray(values, dtype=float)
    if array.shape != recording.time.shape:
        raise ValueError(
            f"{recording.name} has {len(recording)} samples, but the simulated "
            f"samples have shape {array.shape}; sample them at `recording.time`."
        )
    return array


def _horizontal(recording: Recording, turns: float, start: float | None):
    """Return the horizontal positions, the samples to draw, and the axis label."""
    first = 0 if start is None else int(np.searchsorted(recording.time, start))
    later = np.arange(len(recording)) >= first
    if "cam_angle_rad" not in recording.channels:
        return recording.time, later, labelled("time", "s")
    turned = recording["cam_angle_rad"] / (2 * np.pi)
    # the cam angle increases or decreases depending on the sense of rotation
    turned = turned if turned[-1] >= turned[0] else -turned
    begin = turned[min(first, len(turned) - 1)]
    return turned - np.floor(begin), later & (turned - begin <= turns), "cam (turns)"


def _largest(values: np.ndarray) -> float:
    values = np.abs(values[np.isfinite(values)])
    return float(values.max()) if len(values) else 0.0
