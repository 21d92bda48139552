"""Cam shapes: profiles, motion programs, motion laws and contours."""

from ._cam_contour import (
    CamContour as CamContour,
    flat_oscillating_contour as flat_oscillating_contour,
    flat_translating_contour as flat_translating_contour,
    profile_jet as profile_jet,
    roller_oscillating_contour as roller_oscillating_contour,
    roller_translating_contour as roller_translating_contour,
)
from ._eccentric_circle import EccentricCircle as EccentricCircle
from ._fourier_profile import FourierProfile as FourierProfile
from ._motion_law import (
    LawPiece as LawPiece,
    MOTION_LAWS as MOTION_LAWS,
    MotionLaw as MotionLaw,
)
from ._motion_program import (
    Joint as Joint,
    MotionPieces as MotionPieces,
    MotionProgram as MotionProgram,
    Segment as Segment,
)
from ._profile import CamProfile as CamProfile
from ._spline_profile import (
    PiecewiseProfile as PiecewiseProfile,
    SplineProfile as SplineProfile,
)
