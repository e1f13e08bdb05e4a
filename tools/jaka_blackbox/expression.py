"""Conditions on fields of messages, such as ``/force.wrench.force.z > 30 and not /io.data``, in Python's own grammar.

The language has numbers, ``'texts'``, ``true`` and ``false``; fields as ``TOPIC.field.field[index]``; ``+ - *``;
comparisons; ``and``, ``or``, ``not``; ``abs``, ``min`` and ``max``, which take whole arrays, too. ``min`` and ``max``
leave NaN out, and are NaN where nothing else is left; compared, it is neither larger, smaller nor equal.
Python parses it with a name in place of each field, number and text; nothing of it is given to Python to execute.
"""
import ast
import math
import operator
import re
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Tuple

from jaka_bag.errors import UsageError

_TOKEN = re.compile(r"""\s*(?:
    (?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
  | (?P<text>'[^']*'|"[^"]*")
  | (?P<sign><=|>=|==|!=|<|>|\+|-|\*|\(|\)|,)
  | (?P<name>[~/A-Za-z][\w/]*(?:\.[A-Za-z_]\w*|\[[0-9]+\])*)
)""", re.VERBOSE)
_LONGEST = 1000
"""Most characters of a condition: each incident's page shows it."""
_DEEPEST = 40
"""Most brackets inside each other: Python's parser has a limit of its own, with an error that nobody understands."""
_HIGHEST = 250
"""Levels of a tree; each term of a sum is one."""
_CONSTANTS = {"true": True, "false": False}
_OPERATORS: Dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Lt: operator.lt, ast.LtE: operator.le,
    ast.Gt: operator.gt, ast.GtE: operator.ge, ast.Eq: operator.eq, ast.NotEq: operator.ne}
_GRAMMAR = (ast.BoolOp, ast.And, ast.Or, ast.UnaryOp, ast.Not, ast.USub, ast.BinOp, ast.Compare, ast.Call, ast.Name,
            ast.Load, *_OPERATORS)

Values = Mapping[str, Mapping[str, Any]]
"""The newest message of each topic, as ``ValueReader`` gives it."""


class FieldName(NamedTuple):
    """A field of a topic's messages: names and, for elements of arrays, their positions."""

    topic: str
    path: Tuple[Any, ...]

    @property
    def names(self) -> Tuple[str, ...]:
        """The path without positions."""
        return tuple(step for step in self.path if isinstance(step, str))

    def value(self, values: Values) -> Any:
        """Return what the newest messages have there.

        Raises:
            NoValue: They have nothing there: no message has come yet, or an array is too short.
        """
        value: Any = values.get(self.topic)
        try:
            for step in self.path:
                value = value[step]
        except (TypeError, KeyError, IndexError):
            raise NoValue("%s has no value yet at %s" % (self.topic, list(self.path))) from None
        return value


class NoValue(Exception):
    """The condition cannot be computed from these messages: one is missing, or an array is too short."""


def _number(value: Any) -> Any:
    """Return the value if it is a number.

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
    return [value for value in map(_number, found) if value == value] or [math.nan]


def _absolute(values: List[Any]) -> Any:
    if isinstance(values[0], (list, bytes)):
        return [abs(_number(value)) for value in values[0]]
    return abs(_number(values[0]))


_FUNCTIONS: Dict[str, Callable[[List[Any]], Any]] = {
    "abs": _absolute, "min": lambda values: min(_all_numbers(values)), "max": lambda values: max(_all_numbers(values))}


class Expression:
    """A condition that a user wrote.

    Args:
        text: The condition as written.
        resolve: Makes a global name of a topic's name.

    Attributes:
        text: The condition as written.
        fields: The fields that it looks at.

    Raises:
        UsageError: It is not understood; the text shows where.
    """

    def __init__(self, text: str, resolve: Callable[[str], str] = str) -> None:
        self.text = text
        self.fields: List[FieldName] = []
        self._resolve = resolve
        self._leaves: List[Any] = []
        self._tree = self._parse()
        self._check(self._tree)
        if not self.fields:
            raise UsageError("the trigger %r looks at no field: write TOPIC.FIELD > NUMBER" % text)

    @property
    def topics(self) -> Tuple[str, ...]:
        """The topics that it looks at, each once."""
        return tuple(dict.fromkeys(field.topic for field in self.fields))

    def holds(self, values: Values) -> bool:
        """Return whether the condition is met.

        Raises:
            NoValue: The condition cannot be computed.
        """
        try:
            return bool(self._value(self._tree, values))
        except OverflowError as error:
            raise NoValue(str(error)) from error

    def _error(self, reason: str) -> UsageError:
        return UsageError("the trigger %r is not understood: %s" % (self.text, reason))

    def _parse(self) -> ast.expr:
        """Return the tree of the condition; the name ``_N`` stands for leaf N, a field, a number or a text."""
        if len(self.text) > _LONGEST:
            raise UsageError("a trigger has at most %d characters" % _LONGEST)
        written, words, depth = "", [(0, "")], 0
        at, end = 0, len(self.text.rstrip())
        while at < end:
            match = _TOKEN.match(self.text, at)
            if match is None:
                raise self._error("nothing begins with %.20r" % self.text[at:].strip())
            at, kind = match.end(), str(match.lastgroup)
            word = match.group(kind)
            depth += {"(": 1, ")": -1}.get(word, 0)
            if not 0 <= depth <= _DEEPEST:
                raise self._error("a ')' is too much" if depth < 0 else "it is nested too deeply")
            words.append((len(written), word))
            written += self._in_python(kind, word, self.text[at:].lstrip().startswith("(")) + " "
        if depth:
            raise self._error("a ')' is missing")
        try:
            return ast.parse(written, mode="eval").body
        except SyntaxError as error:
            if not 0 < (error.offset or 0) < len(written):  # at the end, which Pythons count otherwise
                raise self._error("it ends too early") from None
            found = [word for begin, word in words if begin < (error.offset or 0)][-1]
            raise self._error("%r stands where something else is expected" % found) from None

    def _in_python(self, kind: str, word: str, is_called: bool) -> str:
        """Return a word of the condition as it stands for Python; note what is a leaf."""
        if kind == "sign" or word in ("and", "or", "not") or word in _FUNCTIONS and is_called:
            return word
        leaf: Any = self._field(word) if kind == "name" and word not in _CONSTANTS else _CONSTANTS.get(word)
        if kind == "number":
            leaf = float(word)
        elif kind == "text":
            leaf = word[1:-1]
        self._leaves.append(leaf)
        return "_%d" % (len(self._leaves) - 1)

    def _field(self, word: str) -> FieldName:
        topic, *steps = re.findall(r"[~/A-Za-z][\w/]*|\.\w+|\[[0-9]+\]", word)
        if not steps or not steps[0].startswith("."):
            raise self._error("%r names no field: write TOPIC.FIELD" % word)
        path = tuple(step[1:] if step.startswith(".") else int(step[1:-1]) for step in steps)
        self.fields.append(FieldName(self._resolve(topic), path))
        return self.fields[-1]

    def _check(self, tree: ast.expr) -> None:
        """Refuse what Python's grammar has beside this language."""
        level: List[ast.AST] = [tree]
        for _ in range(_HIGHEST):
            level = [child for node in level for child in ast.iter_child_nodes(node)]
        if level:
            raise self._error("it is nested too deeply")
        for node in ast.walk(tree):
            if not isinstance(node, _GRAMMAR):
                raise self._error("it is no condition")
            if isinstance(node, ast.Compare) and len(node.ops) > 1:
                raise self._error("a comparison has two sides")
            if isinstance(node, ast.Call):
                if not isinstance(node.func, ast.Name) or node.func.id not in _FUNCTIONS or not node.args:
                    raise self._error("it is no condition")
                if node.func.id == "abs" and len(node.args) > 1:
                    raise self._error("abs takes one value")

    def _value(self, node: ast.AST, values: Values) -> Any:
        """Return what a part of the tree amounts to."""
        if isinstance(node, ast.Name):
            leaf = self._leaves[int(node.id[1:])]
            return leaf.value(values) if isinstance(leaf, FieldName) else leaf
        if isinstance(node, ast.BoolOp):
            for part in node.values:
                value = self._value(part, values)
                if bool(value) is not isinstance(node.op, ast.And):
                    break
            return value
        if isinstance(node, ast.UnaryOp):
            value = self._value(node.operand, values)
            return not value if isinstance(node.op, ast.Not) else -_number(value)
        if isinstance(node, ast.BinOp):
            left, right = self._value(node.left, values), self._value(node.right, values)
            return _OPERATORS[type(node.op)](_number(left), _number(right))
        if isinstance(node, ast.Compare):
            left, right = self._value(node.left, values), self._value(node.comparators[0], values)
            try:
                return _OPERATORS[type(node.ops[0])](left, right)
            except TypeError as error:
                raise NoValue(str(error)) from error
        assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name)  # _check refuses all else
        return _FUNCTIONS[node.func.id]([self._value(part, values) for part in node.args])
