"""Conditions on fields of messages, such as ``/force.wrench.force.z > 30 and not /io.data``: parsed and computed here.

The language has numbers, ``'texts'``, ``true`` and ``false``; fields as ``TOPIC.field.field[index]``; ``+ - *``;
comparisons; ``and``, ``or``, ``not``; ``abs``, ``min`` and ``max``, which take whole arrays, too. Nothing else can be
said in it, and nothing of it is given to Python to execute.
"""
import operator
import re
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Tuple

from jaka_bag.errors import UsageError

_TOKEN = re.compile(r"""\s*(?:
    (?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
  | (?P<text>'[^']*'|"[^"]*")
  | (?P<sign><=|>=|==|!=|<|>|\+|-|\*|\(|\)|,)
  | (?P<name>[~/A-Za-z][\w/]*(?:\.[A-Za-z_]\w*|\[[0-9]+\])*)
)""", re.VERBOSE)
_LONGEST = 1000
_DEEPEST = 40
_COMPARISONS: Dict[str, Callable[[Any, Any], Any]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "!=": operator.ne}
_SUMS: Dict[str, Callable[[Any, Any], Any]] = {"+": operator.add, "-": operator.sub}
_CONSTANTS = {"true": True, "false": False}

Values = Mapping[str, Mapping[str, Any]]
"""The newest message of each topic, as ``ValueReader`` gives it."""

_Node = Callable[[Values], Any]


class FieldName(NamedTuple):
    """A field of a topic's messages: names and, for elements of arrays, their positions."""

    topic: str
    path: Tuple[Any, ...]

    @property
    def names(self) -> Tuple[str, ...]:
        """The path without positions."""
        return tuple(step for step in self.path if isinstance(step, str))


class NoValue(Exception):
    """The condition cannot be computed from these messages: one is missing, or an array is too short."""


def _number(value: Any) -> Any:
    """A value that can be calculated with.

    Raises:
        NoValue: It is a text, an array or a message.
    """
    if not isinstance(value, (bool, int, float)):
        raise NoValue("%.40r is not a number" % (value,))
    return value


def _all_numbers(values: List[Any]) -> List[Any]:
    found: List[Any] = []
    for value in values:
        found.extend(value if isinstance(value, (list, bytes)) else [value])
    if not found:
        raise NoValue("an array is empty")
    return [_number(value) for value in found]


def _absolute(values: List[Any]) -> Any:
    if isinstance(values[0], (list, bytes)):
        return [abs(_number(value)) for value in values[0]]
    return abs(_number(values[0]))


_FUNCTIONS: Dict[str, Callable[[List[Any]], Any]] = {
    "abs": _absolute, "min": lambda values: min(_all_numbers(values)), "max": lambda values: max(_all_numbers(values))}


class Expression:
    """A condition that a user wrote.

    Args:
        text: As written.
        resolve: Makes a global name of a topic's name.

    Attributes:
        text: As written.
        fields: The fields that it looks at.

    Raises:
        UsageError: It is not understood; the text shows where.
    """

    def __init__(self, text: str, resolve: Callable[[str], str] = str) -> None:
        self.text = text
        self.fields: List[FieldName] = []
        self._resolve = resolve
        self._tokens = self._cut()
        self._at = 0
        self._depth = 0
        self._node = self._either()
        if self._at < len(self._tokens):
            raise self._error("%r is too much" % self._tokens[self._at][1])
        if not self.fields:
            raise UsageError("the trigger %r looks at no field: write TOPIC.FIELD > NUMBER" % text)

    @property
    def topics(self) -> Tuple[str, ...]:
        """The topics that it looks at, each once."""
        return tuple(dict.fromkeys(field.topic for field in self.fields))

    def holds(self, values: Values) -> bool:
        """Whether the condition is met.

        Raises:
            NoValue: That cannot be told.
        """
        try:
            return bool(self._node(values))
        except OverflowError as error:
            raise NoValue(str(error)) from error

    def _error(self, reason: str) -> UsageError:
        return UsageError("the trigger %r is not understood: %s" % (self.text, reason))

    def _cut(self) -> List[Tuple[str, str]]:
        if len(self.text) > _LONGEST:
            raise UsageError("a trigger has at most %d characters" % _LONGEST)
        tokens, at, end = [], 0, len(self.text.rstrip())
        while at < end:
            match = _TOKEN.match(self.text, at)
            if match is None:
                raise self._error("nothing begins with %.20r" % self.text[at:].strip())
            tokens.append((str(match.lastgroup), match.group(str(match.lastgroup))))
            at = match.end()
        return tokens

    def _next(self, *wanted: str) -> Optional[str]:
        """Take the next word where it is one of these."""
        if self._at < len(self._tokens) and self._tokens[self._at][0] != "text" \
                and self._tokens[self._at][1] in wanted:
            self._at += 1
            return self._tokens[self._at - 1][1]
        return None

    def _either(self) -> _Node:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise self._error("it is nested too deeply")
        node = self._both()
        while self._next("or"):
            node = self._joined(node, self._both(), lambda one, other, values: one(values) or other(values))
        self._depth -= 1
        return node

    def _both(self) -> _Node:
        node = self._negated()
        while self._next("and"):
            node = self._joined(node, self._negated(), lambda one, other, values: one(values) and other(values))
        return node

    @staticmethod
    def _joined(one: _Node, other: _Node, join: Callable[[_Node, _Node, Values], Any]) -> _Node:
        return lambda values: join(one, other, values)

    def _negated(self) -> _Node:
        turns = 0
        while self._next("not"):
            turns += 1
        node = self._comparison()
        return node if not turns else lambda values: bool(node(values)) ^ bool(turns % 2)

    def _comparison(self) -> _Node:
        left = self._sum()
        sign = self._next(*_COMPARISONS)
        if sign is None:
            return left
        right, compare = self._sum(), _COMPARISONS[sign]

        def compared(values: Values) -> Any:
            try:
                return compare(left(values), right(values))
            except TypeError as error:
                raise NoValue(str(error)) from error
        return compared

    def _sum(self) -> _Node:
        node = self._product()
        while True:
            sign = self._next(*_SUMS)
            if sign is None:
                return node
            node = self._calculated(node, self._product(), _SUMS[sign])

    def _product(self) -> _Node:
        node = self._signed()
        while self._next("*"):
            node = self._calculated(node, self._signed(), operator.mul)
        return node

    @staticmethod
    def _calculated(one: _Node, other: _Node, calculate: Callable[[Any, Any], Any]) -> _Node:
        return lambda values: calculate(_number(one(values)), _number(other(values)))

    def _signed(self) -> _Node:
        turns = 0
        while self._next("-"):
            turns += 1
        node = self._value()
        return node if not turns else lambda values: _number(node(values)) * (-1) ** turns

    def _value(self) -> _Node:
        if self._next("("):
            node = self._either()
            self._close()
            return node
        if self._at >= len(self._tokens):
            raise self._error("it ends too early")
        kind, word = self._tokens[self._at]
        self._at += 1
        if kind == "number":
            number = float(word)
            return lambda values: number
        if kind == "text":
            return lambda values: word[1:-1]
        if word in _CONSTANTS:
            return lambda values: _CONSTANTS[word]
        if word in _FUNCTIONS and self._next("("):
            return self._call(word)
        if kind != "name":
            raise self._error("%r stands where a value is expected" % word)
        return self._field(word)

    def _close(self) -> None:
        if not self._next(")"):
            raise self._error("a ')' is missing")

    def _call(self, name: str) -> _Node:
        arguments = [self._either()]
        while self._next(","):
            arguments.append(self._either())
        self._close()
        if name == "abs" and len(arguments) > 1:
            raise self._error("abs takes one value")
        function = _FUNCTIONS[name]
        return lambda values: function([argument(values) for argument in arguments])

    def _field(self, word: str) -> _Node:
        topic, *steps = re.findall(r"[~/A-Za-z][\w/]*|\.\w+|\[[0-9]+\]", word)
        if not steps or not steps[0].startswith("."):
            raise self._error("%r names no field: write TOPIC.FIELD" % word)
        path = tuple(step[1:] if step.startswith(".") else int(step[1:-1]) for step in steps)
        field = FieldName(self._resolve(topic), path)
        self.fields.append(field)

        def value_of(values: Values) -> Any:
            value: Any = values.get(field.topic)
            try:
                for step in field.path:
                    value = value[step]
            except (TypeError, KeyError, IndexError):
                raise NoValue("%s has no value yet" % word) from None
            return value
        return value_of
