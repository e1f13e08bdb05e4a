"""Control: one page at a time may move the arm; another one asks for it, and both are notified."""
from typing import NamedTuple, Optional

ANSWER_S = 10.0
"""Time, s, that the page in control has to answer a request for it; without an answer nobody sits there."""


class Asked(NamedTuple):
    """A page's request for control, pending until a moment, monotonic time, s."""

    page: str
    until: float


class Control:
    """The page that has control of the arms; pages are known by their ids.

    Attributes:
        holder: The page that has control, None where nobody has.
        asked: The pending request to the holder; None where there is none.
    """

    def __init__(self) -> None:
        self.holder: Optional[str] = None
        self.asked: Optional[Asked] = None

    def take(self, page: str, now: float) -> bool:
        """Request control for a page; return True if it has control now, False if the holder is asked first.

        While one page asks, another one that wants it does not replace it.
        """
        if self.holder in (None, page):
            self._give(page)
            return True
        if self.asked is None:
            self.asked = Asked(page, now + ANSWER_S)
        return False

    def answer(self, page: str, give: bool) -> Optional[str]:
        """Answer the pending request for the holder; return the page that had asked, None if none had."""
        if page != self.holder or self.asked is None:
            return None
        asker = self.asked.page
        if give:
            self._give(asker)
        self.asked = None
        return asker

    def leave(self, page: str) -> bool:
        """Release a page's control or request, to whoever has asked for it; return whether anything has changed."""
        if self.asked is not None and page == self.asked.page:
            self.asked = None
            return page != self.holder
        if page != self.holder:
            return False
        asked, self.holder, self.asked = self.asked, None, None
        if asked is not None:
            self._give(asked.page)
        return True

    def tick(self, now: float) -> bool:
        """Time passes; True where a holder that did not answer has lost control."""
        if self.asked is None or now < self.asked.until:
            return False
        self._give(self.asked.page)
        return True

    def _give(self, page: str) -> None:
        self.holder, self.asked = page, None
