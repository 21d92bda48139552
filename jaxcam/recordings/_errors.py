"""Errors raised when a recording or a rig file cannot be used."""


class RecordingError(ValueError):
    """A file cannot be used as a recording; the message says how to fix it.

    Examples:
        >>> from jaxcam.recordings import RecordingError, read_recording
        >>> try:
        ...     read_recording("absent.csv")
        ... except RecordingError as error:
        ...     print(error)
        absent.csv: there is no such file; check the path.
    """


class RigError(ValueError):
    """A rig file cannot be used; the message says how to fix it.

    Examples:
        >>> from jaxcam.recordings import RigError, read_rig
        >>> try:
        ...     read_rig("absent.toml")
        ... except RigError as error:
        ...     print("absent.toml" in str(error))
        True
    """
