"""Impacting systems of the thesis and of textbooks, and the parts they are made of."""

from ._bouncing_ball import BouncingBall as BouncingBall
from ._cam_follower import CamFollower as CamFollower
from ._eccentric_circle import EccentricCircle as EccentricCircle
from ._fourier_profile import FourierProfile as FourierProfile
from ._impact_oscillator import ImpactOscillator as ImpactOscillator
from ._presets import preset as preset
from ._profile import CamProfile as CamProfile
from ._restitution import (
    ConstantRestitution as ConstantRestitution,
    LinearInSpeed as LinearInSpeed,
    PowerLawRestitution as PowerLawRestitution,
)
from ._saved import (
    load_system as load_system,
    save_system as save_system,
    system_from_json as system_from_json,
    system_to_json as system_to_json,
)
from ._spline_profile import (
    PiecewiseProfile as PiecewiseProfile,
    SplineProfile as SplineProfile,
)
from ._triple_integrator import TripleIntegrator as TripleIntegrator
from ._units import rad_s_to_rpm as rad_s_to_rpm, rpm_to_rad_s as rpm_to_rad_s
