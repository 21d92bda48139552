"""The square-root map near grazing: most iterations change the state only slightly and
linearly, but an occasional impact moves it far away."""

import variational
from jaxcam.plotting import cobweb


def nordmark(x):
    return variational.nordmark_map(x, 0.12, 0.62)


figure = cobweb(nordmark, start=0.05, turns=60, skip=500, edge=0.12)
