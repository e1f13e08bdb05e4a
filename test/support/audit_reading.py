"""Readers of a driver's audit log for tests."""
import json
from pathlib import Path

from jaka_bag.operations.audit_log import verify_audit


def lines_of(folder):
    """Return the lines of the one log below a folder, as dictionaries; those that are no JSON are left out."""
    found = []
    for path in sorted(Path(str(folder)).rglob("*.jsonl")):
        for line in path.read_bytes().splitlines():
            try:
                found.append(json.loads(line.decode("utf-8")))
            except ValueError:
                continue
    return found


def whole(folder):
    """Return the account of the one log below a folder, which must be whole."""
    account, = verify_audit([str(folder)])
    assert account.defect is None, account.defect
    return account


def those_of(folder, kind, **fields):
    """Return the lines of a kind that have these fields."""
    return [line for line in lines_of(folder) if line["kind"] == kind
            and all(line.get(name) == value for name, value in fields.items())]
