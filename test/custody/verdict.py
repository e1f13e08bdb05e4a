"""How a broken rule is told, and which rules there are."""
from typing import Dict

RULES: Dict[str, str] = {
    "a": "the arm does not move without custody",
    "b": "what was asked before an answered stop moves nothing after it",
    "c": "a jog ends when it is called for no more",
    "d": "nothing powers or enables after a fault, a restart or a lost link without a call",
    "e": "every call is answered once, in time, and the answer is true",
    "f": "no frame on the wire leaves the limits",
    "g": "what is shown as new was true a moment ago",
    "h": "the guard knows whenever the arm moves",
    "i": "a stop goes out at once",
    "j": "the arm does not move unseen",
    "k": "an arm at rest is free again",
    "l": "when all is well, the driver is ready again",
    "m": "what the driver began to stop comes to rest, however often the stop is refused or lost",
    "n": "a controller that is not the one that was meant is left alone",
    "p": "what is paused rests until it is resumed",
    "q": "a path's segments are run in order, each once, and what is told of them is true",
    "r": "a program that the driver began runs in its custody only",
    "t": "a trajectory's frames are on its path, and smooth",
    "v": "a velocity jog begins after rest was said, and rests 0.3 s after its last message that counts",
    "contract": "the core keeps its contract with the shell",
}


class RuleBroken(Exception):
    """A rule does not hold.

    Attributes:
        rule: One of RULES.
        at: Virtual time, s.
        text: What happened.
    """

    def __init__(self, rule: str, at: float, text: str) -> None:
        super().__init__("rule %s (%s) broken at %.4f s: %s" % (rule, RULES[rule], at, text))
        self.rule, self.at, self.text = rule, at, text
