"""Systems with impacts or switching surfaces, Filippov systems, cams and restitution
laws.
"""

from ._belt_oscillator import BeltOscillator as BeltOscillator
from ._bilinear_oscillator import BilinearOscillator as BilinearOscillator
from ._bouncing_ball import BouncingBall as BouncingBall
from ._cam_follower import CamFollower as CamFollower
from ._contact_load import (
    contact_force as contact_force,
    contact_load as contact_load,
    float_speed as float_speed,
)
from ._desmodromic import DesmodromicCam as DesmodromicCam
from ._dry_friction_oscillator import DryFrictionOscillator as DryFrictionOscillator
from ._forced_oscillator import ForcedOscillator as ForcedOscillator
from ._gear_backlash import GearBacklash as GearBacklash
from ._impact_oscillator import ImpactOscillator as ImpactOscillator
from ._inclined_shaker import InclinedShaker as InclinedShaker
from ._piecewise_linear import (
    PiecewiseLinear as PiecewiseLinear,
    planar_stability as planar_stability,
)
from ._presets import preset as preset
from ._rattling_gear import RattlingGear as RattlingGear
from ._relay_feedback import RelayFeedback as RelayFeedback
from ._relief_valve import ReliefValve as ReliefValve
from ._restitution import (
    ConstantRestitution as ConstantRestitution,
    LinearInSpeed as LinearInSpeed,
    PowerLawRestitution as PowerLawRestitution,
)
from ._rocking_block import RockingBlock as RockingBlock
from ._spinning_ball import SpinningBall as SpinningBall
from ._spring_mass_runner import SpringMassRunner as SpringMassRunner
from ._through_joints import simulate_through_joints as simulate_through_joints
from ._triple_integrator import TripleIntegrator as TripleIntegrator
from ._two_sided_stop import TwoSidedStop as TwoSidedStop
from ._units import rad_s_to_rpm as rad_s_to_rpm, rpm_to_rad_s as rpm_to_rad_s
from ._valve_train import ValveTrain as ValveTrain
from ._woodpecker_toy import WoodpeckerToy as WoodpeckerToy
from .cams import (
    CamProfile as CamProfile,
    EccentricCircle as EccentricCircle,
    flat_oscillating_contour as flat_oscillating_contour,
    flat_translating_contour as flat_translating_contour,
    FourierProfile as FourierProfile,
    MotionProgram as MotionProgram,
    roller_oscillating_contour as roller_oscillating_contour,
    roller_translating_contour as roller_translating_contour,
    Segment as Segment,
    SplineProfile as SplineProfile,
)
from .saved import load_system as load_system, save_system as save_system
