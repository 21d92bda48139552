"""Physics that a model may lack, and systems that include it.

A `Term` has one or more strengths; a `Shape` is a free function that shows where
physics is missing and on what it depends.
"""

from ._bivariate import Bivariate as Bivariate, BivariateForce as BivariateForce
from ._coordinates import coordinates as coordinates
from ._families import (
    Factor as Factor,
    families as families,
    Family as Family,
    free_basis as free_basis,
)
from ._fitted_function import FittedFunction as FittedFunction
from ._free_function import (
    FREE as FREE,
    FreeFunction as FreeFunction,
    prepared_terms as prepared_terms,
)
from ._hidden_elements import (
    HiddenElement as HiddenElement,
    Hysteresis as Hysteresis,
    Relaxation as Relaxation,
    Resonator as Resonator,
)
from ._hidden_force import (
    ByMotion as ByMotion,
    DIRECT as DIRECT,
    HiddenForce as HiddenForce,
    SHARED as SHARED,
    STARTS as STARTS,
)
from ._library import (
    CoulombFriction as CoulombFriction,
    DriveRipple as DriveRipple,
    library as library,
    saved_classes as saved_classes,
)
from ._location import (
    gaps_of as gaps_of,
    Location as Location,
    other_locations as other_locations,
)
from ._motion_scales import MotionScales as MotionScales
from ._parametric_form import (
    MOST_PARTS as MOST_PARTS,
    Place as Place,
    Primitive as Primitive,
    sum_of as sum_of,
)
from ._primitives import (
    BACKWARD as BACKWARD,
    DRY as DRY,
    FORWARD as FORWARD,
    PRIMITIVES as PRIMITIVES,
)
from ._products import Gate as Gate, GATE_PLACES as GATE_PLACES
from ._scaled import ScaledTerm as ScaledTerm
from ._sensed import (
    fitted_faults as fitted_faults,
    more_faults as more_faults,
    own_faults as own_faults,
    watched as watched,
)
from ._sensor_terms import SensorLag as SensorLag
from ._shapes import (
    Shape as Shape,
    shapes as shapes,
    unit_along as unit_along,
    Variable as Variable,
)
from ._spelled import spelled as spelled
from ._springs import ConstantForce as ConstantForce
from ._switched_base import (
    SwitchedWithHidden as SwitchedWithHidden,
    SwitchedWithTerms as SwitchedWithTerms,
    system_with_element as system_with_element,
    system_with_terms as system_with_terms,
)
from ._term import (
    EVERY as EVERY,
    Motion as Motion,
    SensorTerm as SensorTerm,
    Strength as Strength,
    strength as strength,
    Term as Term,
    terms_of as terms_of,
    watching as watching,
)
from ._value import Value as Value
from ._where import Where as Where
from ._with_hidden import WithHidden as WithHidden
from ._with_terms import base_drive as base_drive, WithTerms as WithTerms
