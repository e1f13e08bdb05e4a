"""The search for what names an arm, a computer or a person in a report that is to be sent to others."""
import re
from typing import Any, Dict, Iterator, List, Tuple

_MAKERS = re.compile(r"serial|robot_id|robot_name|_sn\b|mac_addr|host_?name|user_?name", re.IGNORECASE)
"""Names of fields whose value names one arm, computer or person."""
_HIDDEN = re.compile(r"[x0]*\Z")
_KINDS: Dict[str, "re.Pattern[str]"] = {
    "an address": re.compile(r"(?<![\w.])\d{1,3}(?:\.\d{1,3}){3}(?![\w.])"
                             r"|(?i:\b(?:[0-9a-f]{1,4}:){3,}:?[0-9a-f]{1,4}\b)"),
    "a hardware address": re.compile(r"(?i)\b(?:[0-9a-f]{2}[:-]){5}[0-9a-f]{2}\b|\b(?=[0-9a-f]*\d)[0-9a-f]{12}\b"),
    "a host name": re.compile(r"(?i)\b[a-z0-9-]+\.(?:local|lan|home|internal|corp|invalid|com|net|org|io|de|cn|jp)\b"
                              r"|\b\w+://\S+"),
    "a user name": re.compile(r"(?i)\b[\w.-]+@[\w.-]+|/(?:home|users)/\w+|\\users\\\w+"),
    "a port of a host": re.compile(r"(?i)(?<![\w.])[a-z][\w.-]*:\d{2,5}(?![\w.:-])"),
    "a serial number": re.compile(r"\b(?=[A-Z-]*\d)(?=[\d-]*[A-Z])[A-Z0-9-]{7,}\b|(?<![\w.])\d{6,}(?![\w.])"
                                  r"|(?i:\b(?:SN|S/N|ser(?:ial)?\.? ?(?:no|nr|number)\.?)\W{0,3}(?!x+\b|0+\b)"
                                  r"(?=\w*\d)\w+)"),
    "the name of an arm": re.compile(r"(?i)\bjaka[-_ ]?(?:zu|pro|mini|all|ai|[acs])?[-_ ]?\d*\w?[-_#]\w*\d\w*\b"),
    "a name": re.compile(r"(?i)\b(?:serial|robot_id|robot_name|robot name|hostname)\W+(?!x+\b|0+\b)\w+"),
}


def is_naming(name: str) -> bool:
    """Return whether a field of this name is one whose value names an arm, a computer or a person."""
    return bool(_MAKERS.search(name))


def identity_in(report: Dict[str, Any]) -> List[str]:
    """Return a line for each place of a probe.json's content that may name an arm, a computer or a person.

    It looks at form alone: an arm's name that is an ordinary word is found only in a field of that name.
    """
    found: List[str] = []
    for path, text in _texts(report, ""):
        if path == ".facts.version.value":  # it may have four numbers, as an address
            text = re.sub(r"^\d+(?:[._]\d+)*", "", text)
        found += ["%s: %s, %r" % (path.lstrip("."), kind, match.group())
                  for kind, pattern in _KINDS.items() for match in pattern.finditer(text)]
        if is_naming(path.rpartition(".")[2]) and not _HIDDEN.match(text):
            found.append("%s: a field that names something, %r" % (path.lstrip("."), text))
    return found


def _texts(value: Any, path: str) -> Iterator[Tuple[str, str]]:
    """Return the texts in a value with their places, names and numbers of naming fields among them."""
    if isinstance(value, dict):
        for name, one in value.items():
            yield path + ".(name)", str(name)
            yield from _texts(one, "%s.%s" % (path, name))
    elif isinstance(value, (list, tuple)):
        for one in value:
            yield from _texts(one, path)
    elif isinstance(value, str) or is_naming(path.rpartition(".")[2]):
        yield path, str(value)
