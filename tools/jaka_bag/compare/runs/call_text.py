"""The requests of service calls, as a person typed them, and what one asks for that another does not."""
import re
from typing import Dict, List, Tuple

import numpy as np

from ...driver_interface import REQUEST_UNITS

_NUMBER = re.compile(r"-?\d+\.\d+(?:[eE][-+]?\d+)?|-?\d+[eE][-+]?\d+")


def as_typed(text: str) -> str:
    """Return a message's text with each number as short as it can be told, of 32 bits where it has no more.

    ROS prints the 0.8 of a float32 as 0.800000011920929.
    """
    return _NUMBER.sub(lambda found: _shortest(float(found.group())), text)


def _shortest(value: float) -> str:
    with np.errstate(over="ignore"):
        single = np.float32(value)
    text = str(single) if float(single) == value else repr(value)
    return text[:-2] if text.endswith(".0") else text


def top_level_fields(text: str) -> Dict[str, str]:
    """Return the top-level fields of a message's text; the lines of a nested one are joined by line ends."""
    fields: Dict[str, str] = {}
    name = ""
    for line in text.splitlines():
        if line[:1].strip() and not line.startswith("-") and ":" in line:
            name, _, rest = line.partition(":")
            fields[name] = rest.strip()
        elif name:
            fields[name] += "\n" + line.strip()
    return fields


def changed_fields(ours: str, theirs: str, service: str = "") -> str:
    """Return the fields of a request that another has otherwise: ``pose[1] -100 -> -95 mm, mvvelo 50 -> 40 mm/s``.

    Args:
        ours: The request's text.
        theirs: The other's.
        service: The last part of the service's name, for the units of its fields.
    """
    units = REQUEST_UNITS.get(service, {})
    golden, candidate = (top_level_fields(as_typed(text)) for text in (ours, theirs))
    changes = []
    for name in dict.fromkeys([*golden, *candidate]):
        one, other = golden.get(name, "nothing"), candidate.get(name, "nothing")
        some, others = (_elements(text) for text in (one, other))
        if one == other:
            continue
        if len(some) == len(others) > 1:
            changes += [("%s[%d] %s -> %s %s" % (name, i, a, b, _unit(units, name, i))).rstrip()
                        for i, (a, b) in enumerate(zip(some, others)) if a != b]
        else:
            is_one = len(some) == len(others) == 1
            changes.append(("%s %s -> %s %s" % (name, " ".join(one.split()), " ".join(other.split()),
                                                _unit(units, name, 0) if is_one else "")).rstrip())
    return ", ".join(changes) or "bytes that no text shows"


def _unit(units: Dict[str, Tuple[str, ...]], name: str, index: int) -> str:
    known = units.get(name, ())
    return known[index] if index < len(known) else ""


def _elements(text: str) -> List[str]:
    return text[1:-1].split(", ") if text.startswith("[") and text.endswith("]") else [text]
