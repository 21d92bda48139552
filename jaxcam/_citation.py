"""Return BibTeX entries for the package and for the literature on each topic."""

import re
from importlib.metadata import version
from pathlib import Path


_REFERENCES = Path(__file__).with_name("references.bib")
"""The bibliography, one entry per publication."""

_TOPICS: dict[str, tuple[str, ...]] = {
    "basin entropy": ("daza2016",),
    "basin stability": ("menck2013",),
    "bootstrap": ("rubin1981",),
    "cell mapping": ("hsu1992",),
    "chatter": ("budd1994", "nordmark2009"),
    "chatter interruption": ("alzate2008", "dankowicz2017"),
    "continuation": ("keller1977",),
    "deflation": ("farrell2015",),
    "differential equations": ("kidger2021",),
    "discrepancy": ("desilva2020",),
    "equinox": ("kidger2021equinox",),
    "filippov": ("filippov1988", "leine2004"),
    "gear rattle": ("karagiannis1991",),
    "grazing": ("nordmark1991", "dibernardo2001"),
    "impacting systems": ("dibernardo2008",),
    "lyapunov": ("benettin1980",),
    "normal forms": ("kuznetsov2004",),
    "period doubling": ("feigenbaum1978",),
    "piecewise linear": ("shaw1983", "kahraman1990"),
    "root finding": ("rader2024",),
    "saltation": ("leine2004", "dibernardo2008", "kong2024"),
    "special points": ("govaerts2000", "kuznetsov2004"),
    "thesis": ("alzate2008",),
    "time-stepping": ("moreau1988", "cottle1992", "camlibel2002"),
    "uncertainty exponent": ("mcdonald1985",),
}
"""Topics that can be cited, and the keys of their entries in `references.bib`."""


def citation(*names: str) -> str:
    """Return the BibTeX entries for the given topics.

    Choose the topics that apply to your work. `print(jaxcam.citation())` prints the
    entry of this package, and lists all topics in lines that BibTeX ignores.
    `jaxcam.citation("chatter", "saltation")` returns the entries for both topics,
    without duplicates.

    Args:
        *names: Topics, or keys of individual entries, such as "nordmark1991";
            case-insensitive.

    Returns:
        Text to append to a `.bib` file.

    Raises:
        ValueError: A name is unknown; the message lists the known ones.

    Examples:
        >>> "alzate2008" in jaxcam.citation("thesis")
        True
    """
    if not names:
        lines = ["% Methods, by topic: jaxcam.citation(topic, ...)"]
        lines += [f"%   {topic}: {', '.join(_TOPICS[topic])}" for topic in _TOPICS]
        return _tool() + "\n" + "\n".join(lines) + "\n"
    entries = _entries()
    keys: dict[str, None] = {}
    for name in names:
        asked = name.strip().lower()
        if asked not in _TOPICS and asked not in entries:
            raise ValueError(
                f"{name!r} is not a topic of the bibliography; choose one of "
                f"{', '.join(_TOPICS)}."
            )
        keys |= dict.fromkeys(_TOPICS.get(asked, (asked,)))
    return "\n".join(entries[key] for key in keys)


def _entries() -> dict[str, str]:
    """Return the entries by key; each entry ends with a brace at the start of a
    line.
    """
    text = _REFERENCES.read_text(encoding="utf-8")
    found = re.finditer(r"^@\w+\{([^,\s]+),\n.*?^\}\n", text, re.DOTALL | re.MULTILINE)
    return {entry[1]: entry[0] for entry in found}


def _tool() -> str:
    return (
        "@software{jaxcam,\n"
        "  author = {{jaxcam contributors}},\n"
        "  title = {jaxcam: motion of mechanical systems with impacts},\n"
        f"  version = {{{version('jaxcam')}}},\n"
        "}\n"
    )
