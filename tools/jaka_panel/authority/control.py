"""Control: one page at a time may move the arm; another one asks for it, and both are told."""
from typing import NamedTuple, Optional

ANSWER_S = 10.0
"""s; so long the page that has control is asked. Without an answer nobody sits there."""


class Asked(NamedTuple):
    """A page asks for control until a moment, monotonic time, s."""

    page: str
    until: float


class Control:
    """Which page has control; pages are known by their ids.

    Attributes:
        holder: The page that has control, None where nobody has.
        asked: Who asks the holder for it.
    """

    def __init__(self) -> None:
        self.holder: Optional[str] = None
        self.asked: Optional[Asked] = None

    def take(self, page: str, now: float) -> bool:
        """A page wants control; True where it has it now, False where the holder is asked first.

        While one page asks, another one that wants it does not replace it.
        """
        if self.holder in (None, page):
            self._give(page)
            return True
        if self.asked is None:
            self.asked = Asked(page, now + ANSWER_S)
        return False

    def answer(self, page: str, give: bool) -> Optional[str]:
        """The holder answers who asked; returns the page that had asked, None where there is nothing to answer."""
        if page != self.holder or self.asked is None:
            return None
        asker = self.asked.page
        if give:
            self._give(asker)
        self.asked = None
        return asker

    def leave(self, page: str) -> bool:
        """A page gives control back, or has gone; True where something has changed. Who had asked gets it."""
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
