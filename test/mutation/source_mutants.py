"""Mutants that are made from the source: one small change each, found by walking the syntax tree.

No tool from PyPI fits. mutmut 3.8 needs Python 3.10 and cosmic-ray 8.7 Python 3.9, where 3.8 is the floor here. mutmut
rewrites every function, and cosmic-ray runs one fixed command for every mutant. mutatest 3.1 is pinned to coverage 5
and runs all tests for each mutant.

Not changed, because nothing but a reader could notice: docstrings, annotations, protocols, ``assert``, what is logged,
``__repr__`` and ``__str__``. An order is turned round (``<`` to ``>=``); that ``<`` becomes ``<=`` is tried only where
an operand is a whole number, since times and positions hardly ever meet exactly.
"""
import ast
import hashlib
import itertools
import re
from pathlib import Path
from typing import Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

ROOMS = ("client", "kinematics", "ros", "trajectory")
_TURNED = {ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "==", ast.Is: "is not",
           ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in"}
_EDGE = {ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">"}
_SIGNS = {ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
          ast.FloorDiv: ("//", "/"), ast.Mod: ("%", "*"), ast.Pow: ("**", "*"),
          ast.BitAnd: ("&", "|"), ast.BitOr: ("|", "&")}
_COMPARED = r"not\s+in\b|in\b|is\s+not\b|is\b|[<>=!]=|<|>"
_LOGS = {"log", "_log", "_say", "debug", "info", "warning", "error", "exception", "loginfo", "logwarn", "logerr"}
_TEXTS = {"__repr__", "__str__"}


class SourceMutant(NamedTuple):
    """One change of a source file.

    Attributes:
        file: Path below ``jaka_ros_driver``.
        kind: What is changed: "comparison", "reset", ...
        scope: Dotted name of the function or class, "" for the module.
        line: Where the change begins, from 1.
        start: Begin of the changed bytes in the file.
        end: End of the changed bytes.
        new: The text in their place.
        code: The line before the change, without its indentation.
        changed: The same line after it.
        lines: Lines whose coverage shows which tests may notice.
        count: How many equal changes of equal lines of this scope come before.
    """

    file: str
    kind: str
    scope: str
    line: int
    start: int
    end: int
    new: str
    code: str
    changed: str
    lines: Tuple[int, ...]
    count: int = 0

    @property
    def key(self) -> str:
        """A name that stays the same when lines are shifted."""
        parts = [self.file, self.scope, self.code, self.changed]
        return " | ".join(parts + (["%d" % self.count] if self.count else []))

    def applied(self, source: bytes) -> bytes:
        """Return the file with this change."""
        return source[:self.start] + self.new.encode() + source[self.end:]


class _Walk(ast.NodeVisitor):
    """A walk through one file that collects its mutants."""

    def __init__(self, file: str, source: bytes) -> None:
        self.found: List[SourceMutant] = []
        self._file, self._source = file, source
        self._starts = [0]
        for line in source.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line))
        self._scope: List[str] = []
        self._function: Optional[ast.AST] = None
        self._in_body = False
        self._statement_line = 0

    def visit(self, node: ast.AST) -> None:
        outer = self._statement_line
        if isinstance(node, ast.stmt):
            self._statement_line = node.lineno
        super().visit(node)
        self._statement_line = outer

    # ---- where ----

    def _at(self, line: int, column: int) -> int:
        return self._starts[line - 1] + column

    def _span(self, node: ast.AST) -> Tuple[int, int]:
        return self._at(node.lineno, node.col_offset), self._at(node.end_lineno, node.end_col_offset)

    def _text(self, node: ast.AST) -> str:
        start, end = self._span(node)
        return self._source[start:end].decode()

    def _add(self, kind: str, start: int, end: int, new: str) -> None:
        line = self._source.count(b"\n", 0, start) + 1
        first, last = self._starts[line - 1], max(end, self._source.find(b"\n", start))
        code = self._source[first:last].decode()
        changed = (self._source[first:start] + new.encode() + self._source[end:last]).decode()
        ends = self._source.count(b"\n", 0, end) + 1
        lines = tuple(range(self._statement_line, ends + 1)) if self._in_body else self._body_lines()
        self.found.append(SourceMutant(self._file, kind, ".".join(self._scope), line, start, end, new,
                                       " ".join(code.split()), " ".join(changed.split()), lines))

    def _body_lines(self) -> Tuple[int, ...]:
        """Return the first lines of the function that a line run at import belongs to, or none."""
        body = getattr(self._function, "body", None)
        return tuple(sorted({statement.lineno for statement in body} | {body[-1].end_lineno})) if body else ()

    def _replace(self, kind: str, node: ast.AST, *texts: str) -> None:
        for text in texts:
            self._add(kind, *self._span(node), text)

    def _between(self, kind: str, left: ast.AST, right: ast.AST, pattern: str, *texts: str) -> None:
        """Replace the operator that stands between two operands."""
        start, end = self._span(left)[1], self._span(right)[0]
        match = re.search(pattern, self._source[start:end].decode())
        assert match, (self._file, left.lineno)
        for text in texts:
            self._add(kind, start + match.start(), start + match.end(), text)

    # ---- what is left alone ----

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        if any(getattr(base, "id", "") == "Protocol" for base in node.bases):
            return
        self._scope.append(node.name)
        self._visit_body(node.body)
        self._scope.pop()

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        if node.name in _TEXTS:
            return
        outer, was_in_body = self._function, self._in_body
        self._scope.append(node.name)
        self._function, self._in_body = node, False
        for default in [*node.args.defaults, *node.args.kw_defaults]:
            if default is not None:
                self.visit(default)
        self._in_body = True
        self._visit_body(node.body)
        self._function, self._in_body = outer, was_in_body
        self._scope.pop()

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self._reset(node, [node.target], [node.value])
            self.visit(node.value)

    def visit_Assert(self, node: ast.Assert) -> None:
        pass

    def _visit_body(self, body: Sequence[ast.stmt]) -> None:
        for statement in body:
            self.visit(statement)

    # ---- what is changed ----

    def visit_Call(self, node: ast.Call) -> None:
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        if name in _LOGS:
            return
        if name in ("any", "all") and isinstance(node.func, ast.Name):
            self._replace("any/all", node.func, "all" if name == "any" else "any")
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        left = node.left
        for operator, right in zip(node.ops, node.comparators):
            is_whole = any(_is_whole(side) for side in (left, right))
            texts = [_TURNED[type(operator)]]
            if is_whole and type(operator) in _EDGE:
                texts.append(_EDGE[type(operator)])
            self._between("comparison", left, right, _COMPARED, *texts)
            left = right
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        before, after = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:]):
            self._between("and/or", left, right, r"\b%s\b" % before, after)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.Not):
            self._replace("not", node, self._text(node.operand) if _is_simple(node.operand)
                          else "(%s)" % self._text(node.operand))
        elif isinstance(node.op, ast.USub) and not isinstance(node.operand, ast.Constant):
            self._replace("sign", node, self._text(node.operand))
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        is_text = any(isinstance(side, (ast.JoinedStr, ast.List, ast.Tuple, ast.ListComp))
                      or isinstance(getattr(side, "value", None), str) and isinstance(side, ast.Constant)
                      for side in (node.left, node.right))
        if not is_text and type(node.op) in _SIGNS:
            before, after = _SIGNS[type(node.op)]
            self._between("arithmetic", node.left, node.right, re.escape(before), after)
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        if type(node.op) in _SIGNS:
            before, after = _SIGNS[type(node.op)]
            self._between("arithmetic", node.target, node.value, re.escape(before) + "=", after + "=")
        self.visit(node.value)

    def visit_If(self, node: ast.If) -> None:
        if getattr(node.test, "id", getattr(node.test, "attr", "")) == "TYPE_CHECKING":
            return
        self._guard(node.test, "True", "False")
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self._guard(node.test)
        self.generic_visit(node)

    def visit_While(self, node: ast.While) -> None:
        if not isinstance(node.test, ast.Constant):
            self._replace("guard", node.test, "False")
        self.generic_visit(node)

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for condition in node.ifs:
            self._replace("guard", condition, "True")
        self.generic_visit(node)

    def _guard(self, test: ast.expr, *texts: str) -> None:
        self._replace("guard", test, "not (%s)" % self._text(test), *texts)

    def visit_Assign(self, node: ast.Assign) -> None:
        target = node.targets[0]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            self._reset(node, target.elts, node.value.elts)
        else:
            self._reset(node, [target], [node.value])
        self.visit(node.value)

    def _reset(self, node: ast.stmt, targets: Sequence[ast.expr], values: Sequence[ast.expr]) -> None:
        """Leave out an assignment that sets an attribute again; not its first value."""
        if self._scope[-1:] == ["__init__"] or not self._in_body:
            return
        for target, value in zip(targets, values):
            if isinstance(target, ast.Attribute) and _is_plain(value):
                self._replace("reset", value, self._text(target))

    def _leaving(self, node: ast.stmt) -> None:
        body = getattr(self._function, "body", [])
        if not body or node is not body[-1]:
            self._replace("early end", node, "pass")
        self.generic_visit(node)

    visit_Return = visit_Continue = visit_Break = _leaving

    def visit_Raise(self, node: ast.Raise) -> None:
        if "NotImplementedError" not in self._text(node) and node.exc is not None:
            self._leaving(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if type(value) in (int, float):
            text = self._text(node)
            doubled = [] if value == 0 else ["(%s * 2)" % text, "0" if type(value) is int else "0.0"]
            self._replace("constant", node, "(%s + 1)" % text, *doubled)

    def visit_Subscript(self, node: ast.Subscript) -> None:
        if getattr(node.value, "id", "") not in ("Tuple", "List", "Optional", "Dict", "Callable", "Union", "Sequence"):
            self.generic_visit(node)


def _is_whole(node: ast.expr) -> bool:
    if isinstance(node, ast.Constant):
        return type(node.value) is int
    return isinstance(node, ast.Call) and getattr(node.func, "id", "") == "len"


def _is_simple(node: ast.expr) -> bool:
    return isinstance(node, (ast.Name, ast.Attribute, ast.Call, ast.Subscript))


def _is_plain(node: ast.expr) -> bool:
    """Return whether a value means "nothing", or is a flag; an upper-case name is a constant such as ``_NEVER``."""
    if isinstance(node, ast.Constant):
        return node.value is None or node.value in (False, True, 0, "")
    if isinstance(node, (ast.List, ast.Tuple)):
        return not node.elts
    if isinstance(node, ast.Dict):
        return not node.keys
    return isinstance(node, ast.Name) and node.id.lstrip("_").isupper()


def of_source(file: str, source: bytes) -> List[SourceMutant]:
    """Return every mutant of a file, in its order."""
    walk = _Walk(file, source)
    walk.visit(ast.parse(source))
    found: List[SourceMutant] = []
    counts: Dict[str, int] = {}
    for mutant in sorted(walk.found, key=lambda one: (one.start, one.end)):
        count = counts[mutant.key] = counts.get(mutant.key, -1) + 1
        found.append(mutant._replace(count=count))
    return found


def is_change(mutant: SourceMutant, source: bytes) -> bool:
    """Return whether the mutant is Python, and other than the file without it."""
    try:
        return ast.dump(ast.parse(mutant.applied(source))) != ast.dump(ast.parse(source))
    except SyntaxError:
        return False


def of_rooms(package: Path, rooms: Sequence[str] = ROOMS) -> Iterator[SourceMutant]:
    """Return every mutant of these rooms of the package."""
    for room in rooms:
        for path in sorted((package / room).rglob("*.py")):
            yield from of_source(path.relative_to(package).as_posix(), path.read_bytes())


def sample(package: Path, mutants: Sequence[SourceMutant], count: int, seed: int) -> List[SourceMutant]:
    """Choose so many of them, by seed: an edit elsewhere changes nothing in the choice among the rest."""
    shuffled = sorted(mutants, key=lambda one: hashlib.sha256(("%d %s" % (seed, one.key)).encode()).digest())
    changes = (mutant for mutant in shuffled if is_change(mutant, (package / mutant.file).read_bytes()))
    return list(itertools.islice(changes, count))
