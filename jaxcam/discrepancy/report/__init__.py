"""Report a verdict as text and as JSON."""

from ._caveats import Caveat as Caveat, Reason as Reason
from ._diagnosis import (
    Alternative as Alternative,
    Diagnosis as Diagnosis,
    Effect as Effect,
    Verdict as Verdict,
)
from ._formula import formula_of as formula_of
from ._missing import (
    MissingFunction as MissingFunction,
    slopes_of_function as slopes_of_function,
)
from ._words import listed as listed, number as number, spelled as spelled
from ._write import diagnosis_of as diagnosis_of
