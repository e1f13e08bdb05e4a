"""Launch files as bytes, with the places of their elements: for edits that leave every other byte as it is."""
import re
from dataclasses import dataclass, field
from typing import Dict, Iterator, List, NamedTuple, Optional
from xml.parsers import expat

_ATTRIBUTE = re.compile(rb"""\s([\w:.-]+)\s*=\s*("[^"]*"|'[^']*')""")
_TAG = re.compile(rb"""<[\w:.-]+(?:\s+[\w:.-]+\s*=\s*(?:"[^"]*"|'[^']*'))*\s*/?>""")
_ASCII_COMPATIBLE = {"utf-8", "us-ascii", "ascii", "iso-8859-1"}


class UnreadableLaunchFile(ValueError):
    """The error that a file is no XML in which elements can be changed in place; the text has the line."""


class Edit(NamedTuple):
    """The replacement of the bytes from ``begin`` up to ``end``."""

    begin: int
    end: int
    text: bytes


class Attribute(NamedTuple):
    """One attribute: its value as XML means it, and the place of its text between the quotes."""

    value: str
    begin: int
    end: int


@dataclass
class LaunchElement:
    """One element of a launch file.

    Attributes:
        tag: Its name.
        line: The line on which it begins, from 1.
        begin: Place of its ``<``.
        head_end: Place behind the ``>`` of its first tag.
        close: Place of its end tag; ``head_end`` where it has none.
        is_empty: True where it is written ``<.../>``.
        attributes: By name.
        parent: The element around it; None for the first.
        children: The elements within it.
    """

    tag: str
    line: int
    begin: int
    head_end: int
    close: int
    is_empty: bool
    attributes: Dict[str, Attribute]
    parent: "Optional[LaunchElement]" = None
    children: "List[LaunchElement]" = field(default_factory=list)

    def get(self, name: str) -> str:
        """Return the value of an attribute, "" where it is not there."""
        return self.attributes[name].value if name in self.attributes else ""

    def child(self, tag: str, name: str) -> "Optional[LaunchElement]":
        """Return the child with this tag and this attribute ``name``."""
        return next((one for one in self.children if one.tag == tag and one.get("name") == name), None)

    def ancestors(self) -> "Iterator[LaunchElement]":
        """Yield the elements around this one, the nearest first."""
        around = self.parent
        while around is not None:
            yield around
            around = around.parent


def elements(data: bytes) -> List[LaunchElement]:
    """Return every element of a file, in its order.

    Raises:
        UnreadableLaunchFile: It is no XML, declares entities (whose text stands elsewhere), or is in an encoding in
            which ASCII does not stand for itself.
    """
    found: List[LaunchElement] = []
    around: List[LaunchElement] = []
    parser = expat.ParserCreate()

    def begins(tag: str, attributes: Dict[str, str]) -> None:
        begin, line = parser.CurrentByteIndex, parser.CurrentLineNumber
        text = _TAG.match(data, begin)
        if text is None:
            raise UnreadableLaunchFile("line %d: the tag %s cannot be found in the bytes" % (line, tag))
        places = {one.group(1).decode("utf-8", "replace"): one for one in _ATTRIBUTE.finditer(data, begin, text.end())}
        one = LaunchElement(tag, line, begin, text.end(), text.end(), text.group().endswith(b"/>"),
                            {name: Attribute(value, places[name].start(2) + 1, places[name].end(2) - 1)
                             for name, value in attributes.items() if name in places}, around[-1] if around else None)
        if around:
            around[-1].children.append(one)
        found.append(one)
        around.append(one)

    def ends(_: str) -> None:
        one = around.pop()
        if not one.is_empty:
            one.close = parser.CurrentByteIndex

    def declares(_: str, encoding: Optional[str], __: int) -> None:
        if encoding is not None and encoding.lower() not in _ASCII_COMPATIBLE:
            raise UnreadableLaunchFile("line 1: the encoding %s; valid: UTF-8, ASCII, ISO-8859-1" % encoding)

    def has_entity(*_: object) -> None:
        raise UnreadableLaunchFile("line %d: it declares an entity" % parser.CurrentLineNumber)

    parser.StartElementHandler = begins
    parser.EndElementHandler = ends
    parser.XmlDeclHandler = declares
    parser.EntityDeclHandler = has_entity
    if data[:2] in (b"\xff\xfe", b"\xfe\xff") or data[:1] == b"\0" or data[1:2] == b"\0":
        raise UnreadableLaunchFile("line 1: the encoding is not UTF-8 (UTF-16 or binary)")
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise UnreadableLaunchFile("line %d, column %d: no XML: %s" % (
            error.lineno, error.offset + 1, expat.errors.messages[error.code])) from None
    return found


def with_edits(data: bytes, edits: List[Edit]) -> bytes:
    """Return the bytes with every edit made; they must not overlap."""
    for edit in sorted(edits, reverse=True):
        data = data[:edit.begin] + edit.text + data[edit.end:]
    return data


def insertion(data: bytes, element: LaunchElement, lines: List[bytes]) -> Edit:
    """Return the edit that puts these lines, each one element, before everything else within an element.

    Indentation and line ends are those of the file.
    """
    end = _line_end(data, element.head_end)
    outer = _indentation(data, element.begin)
    inner = next((_indentation(data, child.begin) for child in element.children if _is_first(data, child.begin)),
                 outer + (b"\t" if outer.startswith(b"\t") or b"\n\t" in data else b"  "))
    text = b"".join(end + inner + line for line in lines)
    if element.is_empty:
        head = data[element.begin:element.head_end]
        kept = head[:-2].rstrip()
        return Edit(element.begin + len(kept), element.head_end,
                    b">" + text + end + outer + b"</" + element.tag.encode() + b">")
    if b"\n" not in data[element.head_end:element.close]:
        text += end + (inner if element.children else outer)
    return Edit(element.head_end, element.head_end, text)


def _line_end(data: bytes, place: int) -> bytes:
    found = data.find(b"\n", place)
    if found < 0:
        found = data.rfind(b"\n", 0, place)
    return b"\r\n" if found > 0 and data[found - 1:found] == b"\r" else b"\n"


def _indentation(data: bytes, place: int) -> bytes:
    line = data[data.rfind(b"\n", 0, place) + 1:place]
    return line[:len(line) - len(line.lstrip(b" \t"))]


def _is_first(data: bytes, place: int) -> bool:
    return not data[data.rfind(b"\n", 0, place) + 1:place].strip(b" \t")
