"""Numbers as the thesis prints them, for fits and for comparisons."""

import numpy as np


# Table 5.2: speed (rpm) and the two multipliers of P(1,1)
MULTIPLIERS = np.array(
    [
        (135.946698873817, 0.212856564951, 0.996008664393),
        (135.946850039257, 0.214199564174, 0.989769009976),
        (135.947353924057, 0.216351137284, 0.979943000383),
        (135.949033540057, 0.220281698370, 0.962513414400),
        (135.951832900057, 0.224549930832, 0.944309362903),
        (
            147.941373499943,
            -0.467436119698 - 0.300839993821j,
            -0.467436119698 + 0.300839993821j,
        ),
        (
            148.962048199932,
            -0.521622451717 - 0.214489798539j,
            -0.521622451717 + 0.214489798539j,
        ),
        (150.186857839919, -0.467765740979, -0.703735852712),
        (151.656629407902, -0.353243069838, -0.970265166132),
        (153.420355289483, -0.297944998464, -1.206154145399),
    ]
)
SPEEDS = np.real(MULTIPLIERS[:, 0])
TRACES = np.real(MULTIPLIERS[:, 1] + MULTIPLIERS[:, 2])
PRODUCTS = np.real(MULTIPLIERS[:, 1] * MULTIPLIERS[:, 2])
#: the rows close to the fold, where the speed says little about the multipliers
NEAR_FOLD = SPEEDS < 140.0

# Table 6.1, at 152.67 rpm
CHATTER_SPEED = 152.67
#: time in the period (s), angle (rad) and velocity (rad/s) of the follower
ACCUMULATION = (0.33474, 0.30531, 0.86956)
RELEASE = (0.33668, 0.30698, 0.84854)
#: at the end of the period: the follower, and the follower less the cam
SECTION = (0.33717, 0.22313)
SECTION_RELATIVE = (0.00494, 0.22315)
#: digits after the point in Table 6.1
DECIMALS = 5

# Section 5.2.1: where P(1,1) is born, and where it doubles ("close to")
FOLD_SPEED = 135.946
FLIP_SPEED = 152.0
