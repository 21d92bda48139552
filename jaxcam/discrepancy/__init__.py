"""Model discrepancy: find missing physics, its location, name and strength."""

from ._diagnose import diagnose as diagnose
from ._event_causes import event_causes as event_causes
from ._next_experiment import (
    compare_experiments as compare_experiments,
    Experiment as Experiment,
    next_experiments as next_experiments,
)
from ._predictions import Prediction as Prediction, predictions as predictions
from .policy import Policy as Policy
from .report import Diagnosis as Diagnosis, Verdict as Verdict
from .search import with_terms as with_terms
from .terms import library as library, strength as strength, Term as Term
