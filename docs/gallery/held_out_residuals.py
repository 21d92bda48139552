"""Held-out residuals of a simulated recording of a cam-follower: each section is
predicted after a fit to the other sections, by the textbook model, which has no
friction (top), and by the same model with the friction that `diagnose` identified
(bottom)."""

import matplotlib.pyplot as plt

from jaxcam.data import DEMO_RIG
from jaxcam.discrepancy import diagnose
from jaxcam.plotting import style
from jaxcam.plotting.colours import BAND, FLIGHT
from jaxcam.recordings import read_case, read_rig, segment_case


rig = read_rig(DEMO_RIG / "rig.toml")
found = diagnose(rig, segment_case(read_case(DEMO_RIG), rig))
print(found)

with style():
    figure, panels = plt.subplots(2, 1, figsize=(6.4, 4.0), sharex=True, sharey=True)
    words = "textbook model", "with the friction that was identified"
    for ax, parts, word in zip(panels, found.unseen, words, strict=True):
        # one part for each fit that left some sections out
        parts = [part for part in parts if part.record.startswith("run3")]
        band = 2e3 * parts[0].noise
        ax.axhspan(-band, band, color=BAND, alpha=0.5, lw=0, label="noise ± 2σ")
        for part in parts:
            ax.plot(part.time, 1e3 * part.value, ".", ms=1.5, color=FLIGHT)
        ax.set_title(word)
        ax.set_ylabel("residual (mrad)")
    panels[0].legend(loc="lower right", bbox_to_anchor=(1, 1))
    panels[1].set_xlabel("time (s)")
