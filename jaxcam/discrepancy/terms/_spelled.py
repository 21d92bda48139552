"""Names of terms as words."""

import re


_PROPER = ("coulomb", "stribeck")
# systems without a cam have surfaces that follow their drive, too
_OTHERWISE = {"cam_profile_error": "profile_error"}


def spelled(name: str) -> str:
    """Return the name of one or several terms as words, with capitals in the names of
    people.
    """
    words = str(name)
    for one, other in _OTHERWISE.items():
        words = words.replace(one, other)
    # only between words: formulas and numbers in a name also contain plus signs
    words = re.sub(r"(?<=[a-z])\+(?=[a-z])", " + ", words).replace("_", " ")
    for one in _PROPER:
        words = words.replace(one, one.capitalize())
    return words
