"""Control between pages, and how many messages one may send."""
from jaka_panel.authority.control import ANSWER_S, Asked, Control
from jaka_panel.authority.rate_limiter import RateLimiter


def test_what_nobody_has_is_given_and_what_somebody_has_is_asked_for():
    control = Control()
    assert control.take("a", 0.0) and control.holder == "a"
    assert control.take("a", 1.0)
    assert not control.take("b", 2.0) and control.asked == Asked("b", 2.0 + ANSWER_S)
    assert not control.take("c", 3.0) and control.asked.page == "b", "who came first is asked about first"
    assert control.answer("b", True) is None and control.answer("c", True) is None, "only the holder answers"
    assert control.answer("a", False) == "b" and control.holder == "a" and control.asked is None
    assert control.answer("a", True) is None
    control.take("b", 4.0)
    assert control.answer("a", True) == "b" and control.holder == "b"


def test_a_holder_that_does_not_answer_loses_control():
    control = Control()
    control.take("a", 0.0)
    control.take("b", 5.0)
    assert not control.tick(5.0 + ANSWER_S - 0.1) and control.holder == "a"
    assert control.tick(5.0 + ANSWER_S) and control.holder == "b" and control.asked is None
    assert not control.tick(100.0)


def test_who_goes_holds_and_asks_for_nothing_any_more():
    control = Control()
    control.take("a", 0.0)
    control.take("b", 0.0)
    assert control.leave("b") and control.asked is None and control.holder == "a"
    assert not control.leave("b")
    control.take("b", 1.0)
    assert control.leave("a") and control.holder == "b", "who had asked gets it"
    assert control.leave("b") and control.holder is None


def test_a_rate_limit_is_spent_and_comes_back():
    limiter = RateLimiter(10.0, 5.0, 0.0)
    assert [limiter.spend(0.0) for _ in range(6)] == [True] * 5 + [False]
    assert limiter.spend(0.1) and not limiter.spend(0.1)
    assert [limiter.spend(100.0) for _ in range(6)] == [True] * 5 + [False]
