# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # B2. One impact per revolution: the cam-follower
#
# Between 136 and 152 rpm the rig of the thesis (chapter 5) has an orbit with one impact
# per revolution of the cam. The orbit appears at a fold, where it coexists with the
# orbit that sticks, and its period doubles at a flip. The implicit function theorem
# gives the derivatives of the fold speed and of the flip speed with respect to any
# other parameter, without another continuation. These derivatives show, for example,
# the effect of a stiffer spring.

# +
import equinox as eqx
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import continuation
from jaxcam.models import preset, rad_s_to_rpm, rpm_to_rad_s
from jaxcam.plotting import branch_diagram


# -

# ## The branch


# +
def speed(s):
    return s.speed


rig = eqx.tree_at(speed, preset("calibrated"), jnp.asarray(rpm_to_rad_s(145.0)))
start = continuation.periodic_orbits(rig, np.array([0.4245, 1.828]), periods=1)
family = continuation.branch(
    start.problem,
    start,
    speed,
    (rpm_to_rad_s(130.0), rpm_to_rad_s(154.0)),
    direction="both",
)
figure = branch_diagram(
    family,
    x_scale=float(rad_s_to_rpm(1.0)),
    x_label=("speed", "rpm"),
    y_label=("follower angle once per revolution", "rad"),
)
# -

# ## Sensitivity of the fold and the flip

# +
for point in family.special:
    by = continuation.sensitivity(point, speed)
    print(f"{point.kind} at {rad_s_to_rpm(point.parameter):.3f} rpm moves by")
    print(f"  {float(rad_s_to_rpm(by.stiffness)):8.3f} rpm per N/m of spring stiffness")
    print(
        f"  {float(rad_s_to_rpm(by.profile.eccentricity)) / 1e3:8.3f} rpm per mm "
        "of cam eccentricity"
    )
# -

# Free flight is conservative, so the product of the two multipliers of every orbit on
# the branch is r squared. Table 5.2 of the thesis lists ten such pairs. The restitution
# law, which the thesis does not give, was recovered from them.

# +
for point in family.regular[:: len(family.regular) // 5]:
    r = float(rig.restitution(jnp.asarray(point.parameter), jnp.zeros(())))
    product = float(np.prod(point.multipliers).real)
    print(f"{rad_s_to_rpm(point.parameter):7.2f} rpm: {product:.9f} = {r * r:.9f}")
    assert abs(product - r * r) < 1e-7
plt.show()
