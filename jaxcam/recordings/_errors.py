"""Errors raised when a recording or a rig file cannot be used."""


class RecordingError(ValueError):
    """A file that cannot be used as a recording; one sentence says what to do."""


class RigError(ValueError):
    """A rig file that cannot be used; one sentence says what to do."""
