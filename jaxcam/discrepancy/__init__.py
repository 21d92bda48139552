"""What physics a model leaves out: where it acts, its name, its strength."""

from ._diagnose import diagnose as diagnose
from ._diagnosis import Diagnosis as Diagnosis, Effect as Effect, Value as Value
from ._drive import Ripple as Ripple, ripple_of as ripple_of
from ._event_causes import event_causes as event_causes, EventCause as EventCause
from ._event_speeds import event_speeds as event_speeds, EventSpeeds as EventSpeeds
from ._next_experiment import (
    compare_experiments as compare_experiments,
    Experiment as Experiment,
    next_experiments as next_experiments,
)
from ._predictions import Prediction as Prediction, predictions as predictions
from ._structure import Structure as Structure
from ._term import (
    Motion as Motion,
    SensorTerm as SensorTerm,
    Strength as Strength,
    strength as strength,
    Term as Term,
)
from ._terms import library as library, saved_classes as saved_classes
from ._with_terms import WithTerms as WithTerms
