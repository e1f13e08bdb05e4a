"""The outputs of an arm that pages have set, until something else sets them. Pure: no socket, thread or clock."""
from typing import Any, Dict, List, Mapping, Sequence, Tuple

_ROWS = {"digital": "do", "analog": "ao"}
_SAME = 2e-3
"""Difference of an analog value from what was set, as a share of it, that is rounding."""
_SETTLE_S = 2.0
"""Time, s, in which the controller reports what was set; it is read back by then, but status frames come later."""
_EXPECTED_S = 10.0
"""Longest time, s, between a page's call and the change that it makes: that of a short call (``SHORT_S``)."""
Key = Tuple[str, str, int]
"""An output: its bank, "digital" or "analog", its index."""


class HandOutputs:
    """The marks of outputs that were set by hand. What the controller reports ends a mark; it forces nothing."""

    def __init__(self) -> None:
        self._marks: Dict[Key, Dict[str, Any]] = {}
        self._set_at: Dict[Key, float] = {}
        self._is_seen: Dict[Key, bool] = {}
        self._expected: Dict[Key, float] = {}

    def all(self) -> List[Dict[str, Any]]:
        """Return all marks, as JSON has them."""
        return list(self._marks.values())

    def expect(self, key: Key, now: float) -> None:
        """Take that a page is about to set an output: the next call that does so is its own."""
        self._expected = {one: at for one, at in self._expected.items() if now - at < _EXPECTED_S}
        self._expected[key] = now

    def set(self, key: Key, value: Any, by: str, now: float, wall: float) -> None:
        """Mark an output, set and read back, with who did it; ``now``: monotonic time, s; ``wall``: Unix time, s."""
        bank, signal, index = key
        self._marks[key] = {"bank": bank, "signal": signal, "index": index, "value": value, "wall": round(wall, 3),
                            "by": by}
        self._set_at[key], self._is_seen[key] = now, False

    def called(self, key: Key, is_own: bool, now: float) -> bool:
        """Take a call that sets an output, of whomever; return whether a mark ended."""
        if is_own and now - self._expected.pop(key, -1e9) < _EXPECTED_S:
            return False
        return self._marks.pop(key, None) is not None

    def look(self, banks: Mapping[str, Mapping[str, Sequence[Any]]], at: float) -> bool:
        """Compare with what the controller reported at a monotonic time, s; return whether a mark ended."""
        ended = []
        for key, mark in self._marks.items():
            bank, signal, index = key
            row = banks.get(bank, {}).get(_ROWS[signal], ())
            if at <= self._set_at[key] or index >= len(row):
                continue
            if _is_same(row[index], mark["value"]):
                self._is_seen[key] = True
            elif self._is_seen[key] or at - self._set_at[key] > _SETTLE_S:
                ended.append(key)
        for key in ended:
            del self._marks[key]
        return bool(ended)


def _is_same(reported: Any, value: Any) -> bool:
    if type(value) is bool or reported is None:
        return bool(bool(reported) == value)
    return bool(abs(reported - value) <= _SAME * max(1.0, abs(value)))
