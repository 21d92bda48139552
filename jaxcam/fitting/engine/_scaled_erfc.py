"""The scaled complementary error function, `exp(x**2) * erfc(x)`."""

import jax.numpy as jnp


# `(1 + 2 x) exp(x^2) erfc(x)` as a polynomial in (x - 3) / (x + 3), from its values at
# the Chebyshev nodes
_MIDDLE = 3.0
_COEFFICIENTS = (
    1.2530080582697296,
    -0.13562110612458023,
    -0.047562294353490894,
    0.12964515870271823,
    -0.1192736634135223,
    0.06830802734434831,
    -0.023770514950664175,
    0.0025293918170753156,
    0.0018886906585501028,
    -0.000779832300846803,
    -0.00010516146431189631,
    0.00012509952409355348,
    4.955387262246943e-06,
    -2.010110513418846e-05,
    -7.453461754055167e-07,
    3.4734277170892562e-06,
    3.7853273311554403e-07,
    -6.178416858386078e-07,
    -1.641077841786089e-07,
    1.0272703350335427e-07,
    5.663287794065665e-08,
    -1.3670847883859393e-08,
    -1.4114693423959107e-08,
    1.0478647632934695e-09,
    1.8172450519271827e-09,
)


def scaled_erfc(x):
    """Return `exp(x**2) * erfc(x)` for x >= 0, to a relative accuracy of 2e-15.

    `jax.scipy.special.erfcx` (JAX 0.10) is zero for x around 26.6, where `erfc(x)` is
    smaller than a normal number, and takes twice as long.
    """
    place = (x - _MIDDLE) / (x + _MIDDLE)
    found = jnp.full_like(x, _COEFFICIENTS[-1])
    for coefficient in _COEFFICIENTS[-2::-1]:
        found = found * place + coefficient
    return found / (1 + 2 * x)
