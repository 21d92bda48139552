"""Build fitting problems from recordings and a model, and form the normal equations."""

from ._approach_speeds import approach_speeds as approach_speeds
from ._columns import (
    Columns as Columns,
    free_columns as free_columns,
    held_firmer as held_firmer,
    inside as inside,
    invert_information as invert_information,
    linearised as linearised,
    nominal_of as nominal_of,
    off_nominal as off_nominal,
    prior_cost as prior_cost,
    prior_information as prior_information,
    reduced as reduced,
    sound_information as sound_information,
)
from ._damped_step import damped_step as damped_step
from ._discrete_starts import (
    begun_before_switches as begun_before_switches,
    unexplained_jumps as unexplained_jumps,
)
from ._discrete_states import number_of_discrete_states as number_of_discrete_states
from ._each_record import each_record as each_record, of_record as of_record
from ._eliminate import (
    eliminate_states as eliminate_states,
    Reduced as Reduced,
    state_steps as state_steps,
)
from ._event_limit import crowded_pieces as crowded_pieces
from ._extras import Extras as Extras
from ._fly import runge_kutta as runge_kutta
from ._known_constants import with_constants as with_constants
from ._late_switch import JUMP as JUMP
from ._layout import Layout as Layout
from ._linear import linear_pieces as linear_pieces, LinearPieces as LinearPieces
from ._linearise import (
    assemble as assemble,
    Blocks as Blocks,
    cost_by_recording as cost_by_recording,
    cost_of as cost_of,
    Costs as Costs,
    Point as Point,
    predict as predict,
    total_cost as total_cost,
    with_begins as with_begins,
)
from ._model import (
    augmented_field as augmented_field,
    cam_follower_drive as cam_follower_drive,
    DriveState as DriveState,
    filtered_channels as filtered_channels,
    Input as Input,
    INTERPOLATIONS as INTERPOLATIONS,
    measured_components as measured_components,
    Model as Model,
    primary_channel as primary_channel,
    Sensor as Sensor,
    state_channels as state_channels,
    Turning as Turning,
)
from ._modes import (
    discrete_state_of as discrete_state_of,
    first_mode as first_mode,
    surfaces_in as surfaces_in,
)
from ._moving_surface import moves_surface as moves_surface
from ._output import Output as Output
from ._own_states import own_states as own_states
from ._parameter import Parameter as Parameter
from ._pieces import FLIGHT as FLIGHT, IMPACT as IMPACT
from ._problem import Problem as Problem, Weights as Weights
from ._problem_checks import (
    parameter_places as parameter_places,
    refuse_moved_gaps as refuse_moved_gaps,
)
from ._seen_directly import shows_directly as shows_directly
from ._sharpness import (
    allowing as allowing,
    already_loose as already_loose,
    JOINT as JOINT,
    loosened as loosened,
    separated as separated,
)
from ._starts import state_size as state_size
from ._switched_steps import (
    EVENTS as EVENTS,
    states_and_sides as states_and_sides,
    switched_steps as switched_steps,
)
