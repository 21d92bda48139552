"""Fit subsets of terms, and predict gains from a quadratic likelihood about a fit."""

from ._blocks import (
    Blocks as Blocks,
    blocks_of as blocks_of,
    values_of as values_of,
)
from ._clock import Clock as Clock
from ._earlier import (
    rank_decoys as rank_decoys,
    refitted as refitted,
)
from ._extended import extended as extended, with_states as with_states
from ._free_fits import Missing as Missing
from ._free_search import FreeSearch as FreeSearch
from ._gains import (
    added_gain as added_gain,
    gain as gain,
    newton_step as newton_step,
    predicted_gain as predicted_gain,
    separate_gain as separate_gain,
)
from ._given_up import given_up as given_up
from ._heat import heat_of as heat_of, tolerance_at as tolerance_at
from ._hidden_state import Hidden as Hidden
from ._kept_trials import KeptTrials as KeptTrials
from ._leads import decoys_of as decoys_of
from ._local_force import force_blocks as force_blocks, Response as Response
from ._model_error import (
    model_errors_dominate as model_errors_dominate,
    with_model_error as with_model_error,
)
from ._named_terms import with_terms as with_terms
from ._one_direction import (
    in_one_direction as in_one_direction,
    one_direction as one_direction,
    OneDirection as OneDirection,
)
from ._question import (
    Candidates as Candidates,
    FittedSpeed as FittedSpeed,
    Question as Question,
    Report as Report,
)
from ._reference_speed import with_fitted_speed as with_fitted_speed
from ._rig_question import rig_question as rig_question
from ._roughness import occam as occam, Roughness as Roughness, roughness as roughness
from ._search import Search as Search
from ._shuffled import Shuffled as Shuffled
from ._slots import Free as Free, free_term as free_term
from ._starting_at import starting_at as starting_at
from ._system_question import (
    segmented as segmented,
    setup_question as setup_question,
    system_question as system_question,
)
from ._trials import Trial as Trial, Trials as Trials
from ._vibration_scan import Periodogram as Periodogram
from ._within_tolerances import within_tolerances as within_tolerances
