"""The verdict in the words of a mechanical engineer."""


def listed(names) -> str:
    names = [str(name).replace("_", " ") for name in names]
    if not names:
        return "nothing"
    if len(names) == 1:
        return names[0]
    return f"{', '.join(names[:-1])} and {names[-1]}"


def quantity(text: str, unit: str) -> str:
    """A number with its unit; `-` is that of a ratio."""
    return text if unit in ("", "-") else f"{text} {unit}"


def number(value: float, stderr: float, unit: str) -> str:
    """A number with its standard error and unit."""
    return quantity(f"{value:.4g} +- {stderr:.1g}", unit)


def percent(share: float) -> str:
    """A share as an engineer writes it: never more digits than it has."""
    if 0 < share < 0.01:
        return "less than 1 %"
    if 0.99 < share < 1:
        return "more than 99 %"
    return f"{100 * share:.0f} %"
