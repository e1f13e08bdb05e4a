"""The pages and names that are let in; each row is a header that a browser or another client sends."""
import pytest

from jaka_bag.errors import UsageError
from jaka_foxglove.access import AccessRules, is_loopback

RULES = AccessRules(["http://localhost:8080", "file://"], ["robot-pc"])


@pytest.mark.parametrize("origin, host", [
    (None, "127.0.0.1:8765"), (None, "localhost:8765"), (None, "localhost"), (None, "[::1]:8765"),
    (None, "192.168.0.7:8765"), (None, "ROBOT-PC:8765"), (None, "localhost.:8765"),
    ("https://app.foxglove.dev", "localhost:8765"), ("https://lichtblick-suite.github.io", "localhost:8765"),
    ("http://localhost:8080", "127.0.0.1:8765"), ("file://", "127.0.0.1:8765")])
def test_taken(origin, host):
    assert RULES.refusal(origin, host) is None


@pytest.mark.parametrize("origin", [
    "https://evil.example", "http://app.foxglove.dev", "https://app.foxglove.dev.evil.example",
    "https://app.foxglove.dev:444", "https://evil.example/https://app.foxglove.dev", "https://app.foxglove.dev@evil.example",
    "http://localhost:8081", "http://127.0.0.1:8080", "null", "", "https://[", "file://evil", "chrome-extension://abc"])
def test_refused_pages(origin):
    assert "may not connect" in RULES.refusal(origin, "localhost:8765")


@pytest.mark.parametrize("host", [
    None, "", "evil.example", "evil.example:8765", "localhost.evil.example:8765", "127.0.0.1.evil.example:8765",
    "localhost@evil.example:8765", "localhost/x", "localhost:x", "[::1", "0x7f000001:8765"])
def test_refused_names(host):
    assert "is not called" in RULES.refusal(None, host)


def test_without_being_asked_files_and_other_pages_are_refused():
    rules = AccessRules()
    assert rules.refusal("file://", "localhost") and rules.refusal("http://localhost:8080", "localhost")
    assert rules.refusal(None, "robot-pc")


@pytest.mark.parametrize("origin", ["localhost", "localhost:8080", "http://x/page", "*", "", "http://", "data:"])
def test_what_is_no_origin_is_a_usage_error(origin):
    with pytest.raises(UsageError):
        AccessRules([origin])


def test_loopback():
    assert [is_loopback(host) for host in ("127.0.0.1", "::1", "localhost", "127.3.2.1", "0.0.0.0", "::", "10.0.0.1",
                                           "robot-pc")] == [True] * 4 + [False] * 4
