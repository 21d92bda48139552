"""Whether a diagnosis has changed the model."""

from ..discrepancy import Diagnosis


def changed(found: Diagnosis) -> bool:
    """Return whether the diagnosis adds effects to the textbook model.

    If not, residuals and corrections "with the missing effects" are those of the
    textbook model.
    """
    return bool(found.missing) or any(effect.term for effect in found.effects)
