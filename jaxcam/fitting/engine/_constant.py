"""Numbers without derivatives."""

import equinox as eqx
import jax


def constant(tree):
    """Return the same numbers without derivatives, so a loop over them is not
    differentiated.
    """

    def fixed(leaf):
        return jax.lax.stop_gradient(leaf) if eqx.is_inexact_array(leaf) else leaf

    return jax.tree.map(fixed, tree)
