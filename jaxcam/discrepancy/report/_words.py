"""Format numbers for the sentences of a verdict."""

from ..terms import spelled as spelled


def listed(names) -> str:
    names = [spelled(name) for name in names]
    if not names:
        return "nothing"
    if len(names) == 1:
        return names[0]
    return f"{', '.join(names[:-1])} and {names[-1]}"


def quantity(text: str, unit: str) -> str:
    """Return a number with its unit; the unit `-` of a ratio is omitted."""
    return text if unit in ("", "-") else f"{text} {unit}"


def number(value: float, stderr: float, unit: str) -> str:
    """Return a number with its standard error and unit."""
    return quantity(f"{value:.4g} +- {stderr:.1g}", unit)


def ratio(value: float) -> str:
    """Return a ratio with at least two significant digits, and without an exponent."""
    return f"{value:.2g}" if value < 100 else f"{value:.0f}"


def percent(share: float) -> str:
    """Return a fraction as a percentage, without insignificant digits."""
    if 0 < share < 0.01:
        return "less than 1 %"
    if 0.99 < share < 1:
        return "more than 99 %"
    return f"{100 * share:.0f} %"
