"""Counts lines of code: without blank lines, comments and docstrings."""
import ast
import io
import re
import tokenize

NO_CODE = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)


def code_lines(source):
    """Return how many lines of a Python source hold code."""
    texts = {line for node in ast.walk(ast.parse(source))
             if isinstance(node, ast.Expr) and isinstance(getattr(node.value, "value", None), str)
             for line in range(node.lineno, node.end_lineno + 1)}
    code = {line for token in tokenize.generate_tokens(io.StringIO(source).readline) if token.type not in NO_CODE
            for line in range(token.start[0], token.end[0] + 1)}
    return len(code - texts)


def files_named(name, folders):
    """Return the Python files that a name on a page stands for, as ``room/``, ``room/file.py``, ``room/{a,b}.py``."""
    head, _, rest = name.partition("{")
    inner, _, tail = rest.partition("}")
    names = [head + one + tail for one in inner.split(",")] if rest else [name]
    found = [path for folder in folders for one in names
             for path in sorted(folder.glob(one + "*.py" if one.endswith("/") else one))]
    if not found or (rest and len(found) != len(names)):
        raise ValueError("no such files: " + name)
    return found


def lines_of_names(text, folders):
    """Return the lines of code of all files that stand in backquotes in a text."""
    return sum(code_lines(path.read_text(encoding="utf-8"))
               for name in re.findall(r"`([^`]+)`", text) for path in files_named(name, folders))
