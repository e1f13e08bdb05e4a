"""The rules by name, the exception for a broken one, and the checks that the product does not pass yet."""
from typing import Dict

RULES: Dict[str, str] = {
    "a": "the arm does not move without custody",
    "b": "a motion asked for before an answered stop does not run after it",
    "c": "a jog ends when its calls end",
    "d": "nothing powers or enables after a fault, a restart or a lost link without a call",
    "e": "every call is answered once, in time, and the answer is true",
    "f": "no frame on the wire leaves the limits",
    "near": "no joint target on the wire brings the arm into the part of the margin that is certain",
    "g": "a state that is shown as new was true a moment ago",
    "h": "the guard knows whenever the arm moves",
    "i": "a stop goes out at once",
    "j": "the arm does not move unseen",
    "k": "an arm at rest is free again",
    "l": "when all is well, the driver is ready again",
    "left": "what a dead driver left moving is stopped by the first request of the next one that could move the arm",
    "m": "a motion that the driver began to stop comes to rest, however often the stop is refused or lost",
    "n": "a controller with another identity than the one asked for is left alone",
    "p": "a paused motion rests until it is resumed",
    "q": "a path's segments are run in order, each once, and reported truly",
    "r": "a program that the driver began runs in its custody only",
    "t": "a trajectory's frames are on its path, and smooth",
    "stream": "a stream of points is followed smoothly, no farther than its points, and not resumed without a pause",
    "v": "a velocity jog begins after a message of rest, and rests 0.3 s after its last message that counts",
    "age": "a state that is shown as new is at most 0.8 s old, on a link slower than the feed, too",
    "late": "a motion that has not begun 1 s after it was accepted is stopped",
    "against": "whatever contradicts a motion stops it",
    "whole": "a stop is the whole stop: of a jog, of servo mode, of moves and programs",
    "guard": "a driver that dies or freezes leaves no arm in motion behind",
    "goodbye": "a driver that ends in good order leaves the arm at rest",
    "recovery": "a recovery takes each step at most once",
    "burst": "servo frames never come in a burst",
    "state": "the core's own invariants hold after every event",
    "contract": "the core keeps its interface with the shell",
}


class RuleBroken(Exception):
    """A rule that does not hold.

    Attributes:
        rule: A name in RULES.
        at: Virtual time, s.
        text: What happened.
    """

    def __init__(self, rule: str, at: float, text: str) -> None:
        super().__init__("rule %s (%s) broken at %.4f s: %s" % (rule, RULES[rule], at, text))
        self.rule, self.at, self.text = rule, at, text


class Verdicts:
    """The collector of what the slacks are needed for.

    Attributes:
        used: The largest amount of each slack that was needed, by its name: what a slack may be shrunk to.
    """

    def __init__(self) -> None:
        self.used: Dict[str, float] = {}

    def uses(self, slack: str, amount: float) -> None:
        """Note how much of a slack is needed."""
        if amount > self.used.get(slack, 0.0):
            self.used[slack] = amount
