"""Path following of smooth problems and of periodic orbits; their special points."""

import jaxcam as _jaxcam  # noqa: F401  64-bit floats
from variational import chatter_interruption as chatter_interruption

from ._algorithms import (
    AbstractAlgorithm as AbstractAlgorithm,
    MoorePenrose as MoorePenrose,
    Natural as Natural,
    PseudoArclength as PseudoArclength,
)
from ._batch import Batch as Batch, follow_batch as follow_batch
from ._branch import branch as branch
from ._cascade import Cascade as Cascade, cascade as cascade
from ._curve import curve as curve
from ._deflate import deflate as deflate
from ._follow import follow as follow
from ._limit_cycle import LimitCycle as LimitCycle
from ._point import Branch as Branch, Point as Point
from ._predictors import (
    AbstractPredictor as AbstractPredictor,
    Extrapolation as Extrapolation,
    Polynomial as Polynomial,
    Secant as Secant,
    Tangent as Tangent,
)
from ._problem import (
    AbstractProblem as AbstractProblem,
    LocalDynamics as LocalDynamics,
    Monitor as Monitor,
    Start as Start,
)
from ._problems import (
    Equations as Equations,
    Equilibrium as Equilibrium,
    FixedPoint as FixedPoint,
)
from ._record import load as load, Recorder as Recorder, save as save
from ._representation import AbstractRepresentation as AbstractRepresentation
from ._sensitivity import sensitivity as sensitivity, special_point as special_point
from ._settings import Settings as Settings
from ._step_control import (
    AbstractStepControl as AbstractStepControl,
    EffortAndAngle as EffortAndAngle,
    Refusal as Refusal,
    Way as Way,
)
from ._switch import emanating as emanating, switch as switch
from ._table import Progress as Progress, table as table
from .orbits import (
    ImpactingOrbits as ImpactingOrbits,
    orbits_near as orbits_near,
    periodic_orbit as periodic_orbit,
    periodic_orbits as periodic_orbits,
    StickingOrbits as StickingOrbits,
)
