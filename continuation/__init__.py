"""Follow branches of smooth problems and of periodic orbits, with special points."""

import jaxcam as _jaxcam  # noqa: F401  64-bit floats
from variational import chatter_interruption as chatter_interruption

from ._batch import follow_batch as follow_batch
from ._branch import branch as branch
from ._cascade import cascade as cascade
from ._curve import curve as curve
from ._deflate import deflate as deflate
from ._follow import follow as follow
from ._limit_cycle import LimitCycle as LimitCycle
from ._padding import Padded as Padded
from ._point import Branch as Branch, Point as Point
from ._problems import (
    Equations as Equations,
    Equilibrium as Equilibrium,
    FixedPoint as FixedPoint,
)
from ._record import load_branch as load_branch, save_branch as save_branch
from ._sensitivity import sensitivity as sensitivity, special_point as special_point
from ._settings import BranchSettings as BranchSettings
from ._switch import switch as switch
from ._table import PointPrinter as PointPrinter, table as table
from .algorithms import (
    MoorePenrose as MoorePenrose,
    Natural as Natural,
    PseudoArclength as PseudoArclength,
)
from .orbits import (
    ImpactingOrbits as ImpactingOrbits,
    orbits_near as orbits_near,
    periodic_orbit as periodic_orbit,
    periodic_orbits as periodic_orbits,
    SingleShooting as SingleShooting,
    StickingOrbits as StickingOrbits,
)
from .predictors import PolynomialPredictor as PolynomialPredictor
from .problem import (
    AbstractProblem as AbstractProblem,
    Monitor as Monitor,
    Start as Start,
)
