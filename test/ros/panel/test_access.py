"""The access to the panel: Host, Origin, token, limits, files; each attack is tried and its answer checked."""
import contextlib
import json

import pytest
from panel_page import Page, PanelProcess, get, refused
from waiting import eventually

SCRIPT = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def panel(ros_node):
    with PanelProcess("--pages", "3") as panel:
        yield panel


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", "https://127.0.0.1:{port}",
                                    None])
def test_a_socket_from_another_site_is_refused(loop, panel, origin):
    given = origin.format(port=panel.port) if origin else None
    assert refused(loop, panel, Origin=given) == 403


@pytest.mark.parametrize("host", [
    "evil.example", "evil.example:{port}", "127.0.0.1.evil.example:{port}", "192.168.1.5:{port}",
    "user@127.0.0.1:{port}", "127.0.0.1:{port}/x", ""])
def test_a_name_that_is_not_ours_is_refused_whatever_address_it_leads_to(loop, panel, host):
    name = host.format(port=panel.port)
    assert get(loop, panel, "/api/info", Host=name)[0] in (400, 403)
    assert refused(loop, panel, Host=name, Origin="http://" + name) in (400, 403)


@pytest.mark.parametrize("host", ["localhost:{port}", "127.0.0.1:{port}", "[::1]:{port}", "LOCALHOST:{port}"])
def test_our_own_names_are_served(loop, panel, host):
    assert get(loop, panel, "/api/info", Host=host.format(port=panel.port))[0] == 200


def test_a_page_of_another_site_reads_nothing_but_may_link_here(loop, panel):
    assert get(loop, panel, "/api/info", Origin="http://evil.example")[0] == 403
    assert get(loop, panel, "/description?arm=/x", **{"Sec-Fetch-Site": "cross-site"})[0] == 403
    assert get(loop, panel, "/", **{"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"})[0] in (200, 503)
    assert get(loop, panel, "/", **{"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"})[0] == 403


@pytest.mark.parametrize("path", [
    "/web/../settings.py", "/web/%2e%2e/settings.py", "/web/..%2fsettings.py", "/web//etc/passwd", "/web/%2fetc/passwd",
    "/web/.hidden.js", "/web/", "/web/..", "/web/index.html/", "/web/a%00.js", "/web/..\\settings.py",
    "/web/%5c..%5cx.js",
    "/etc/passwd", "/web/index.html%00.png", "/mesh?arm=/x&uri=file:///etc/passwd"])
def test_no_path_leads_out_of_the_pages_folder(loop, panel, path):
    status, _, body = get(loop, panel, path)
    assert status in (400, 403, 404) and b"root:" not in body and b"def " not in body


def test_every_answer_has_the_headers_that_keep_strangers_out(loop, panel):
    for path in ("/", "/api/info", "/nothing", "/web/nothing.js"):
        _, headers, _ = get(loop, panel, path)
        policy = headers["content-security-policy"]
        assert "default-src 'none'" in policy and "unsafe" not in policy and "frame-ancestors 'none'" in policy
        assert headers["x-content-type-options"] == "nosniff" and headers["x-frame-options"] == "DENY"
        assert "access-control-allow-origin" not in headers and "set-cookie" not in headers


@pytest.mark.parametrize("method", ["PUT", "DELETE", "POST", "PATCH", "TRACE", "OPTIONS"])
def test_other_methods_do_nothing(loop, panel, method):
    status, headers, _ = get(loop, panel, "/", method, Origin="http://127.0.0.1:%d" % panel.port)
    assert status == 405 and "access-control-allow-origin" not in headers


@pytest.mark.parametrize("token, why", [(None, "no token"), ("wrong", "wrong token"), (7, "wrong token")])
def test_without_the_token_a_page_only_watches(loop, panel, token, why):
    with Page(loop, panel, token=token) as page:
        assert page.welcome["may"] == "watch" and page.welcome["why"] == why
        for message in ({"kind": "take_control"}, {"kind": "stop", "arm": None},
                        {"cmd": "joint_move", "arm": "/x", "args": {}}, {"cmd": "logs", "arm": None, "args": {}}):
            answer = page.ask(**message)
            assert not answer["ok"] and "token" in answer["message"]
        page.send(t="jog", arm="/x", hold=1, seq=1, clock=0, echo=page.now, space="joint", v=[1] * 6, step=None)
        assert page.wait("error")["code"] == "no_token"


def test_a_stop_by_post_needs_token_and_origin(loop, panel):
    own = "http://127.0.0.1:%d" % panel.port
    good = {"Origin": own, "Authorization": "Bearer " + panel.token, "Content-Length": "0"}
    assert get(loop, panel, "/api/stop", "POST", **good)[0] == 200
    assert get(loop, panel, "/api/stop", "POST", **dict(good, Authorization="Bearer x"))[0] == 401
    assert get(loop, panel, "/api/stop", "POST", **dict(good, Authorization=None))[0] == 401
    assert get(loop, panel, "/api/stop", "POST", **dict(good, Origin=None))[0] == 403
    assert get(loop, panel, "/api/stop", "POST", **dict(good, Origin="http://evil.example"))[0] == 403


@pytest.mark.parametrize("text", ["x" * 70000, "[1]", "no json", "[" * 30000, '{"t": "hello", "v": 2}', "{}"])
def test_what_is_no_hello_ends_the_connection(loop, panel, text):
    with Page(loop, panel, hello=False) as page:
        page.send(text)
        assert eventually(lambda: page.closed is not None) and page.closed in (1008, 1009)


def test_too_long_and_too_many_messages_end_the_connection(loop, panel):
    with Page(loop, panel) as page:
        page.send(json.dumps({"t": "x", "fill": "y" * 70000}))
        assert eventually(lambda: page.closed is not None) and page.closed == 1009
    with Page(loop, panel) as page:
        page.flood(5000, t="nothing")
        assert eventually(lambda: page.closed is not None) and page.closed in (1006, 1008), "cut, or with a reason"


@pytest.mark.parametrize("message", [
    {"t": 5}, {}, {"t": "watch", "arms": 3}, {"t": "watch", "arms": [{}], "rate": "x"}, {"t": "ping", "clock": "x"},
    {"t": "history", "id": {}, "arm": [], "from": "x"}, {"t": "cmd", "id": 1, "cmd": [], "args": 5},
    {"t": "cmd", "id": None, "cmd": "joint_move", "arm": {}}, {"t": "jog", "v": 3}, {"t": "jog_stop", "hold": []},
    {"t": "stop", "arm": {}, "id": 1}, {"t": "answer_control", "give": 1}, {"t": "release_control"},
    {"t": "hello", "v": 1}])
def test_nonsense_changes_nothing(loop, panel, message):
    with Page(loop, panel) as page:
        page.send(json.dumps(message))
        page.send(t="ping", clock=1.0)
        before = page.counts.get("pong", 0)
        assert eventually(lambda: page.counts.get("pong", 0) > before) and page.closed is None


def test_costly_requests_are_answered_so_often_only(loop, panel):
    with Page(loop, panel) as page:
        for _ in range(30):
            page.watch()
        assert page.wait("error")["code"] == "rate" and page.closed is None


def test_pages_beyond_the_limit_are_sent_away(loop, panel):
    with contextlib.ExitStack() as pages:
        for _ in range(3):
            pages.enter_context(Page(loop, panel))
        late = pages.enter_context(Page(loop, panel, hello=False))
        assert eventually(lambda: late.closed is not None) and late.closed == 1013
    assert eventually(lambda: Page(loop, panel).__exit__() is None)


def test_names_are_text_and_come_as_they_are(loop, panel):
    with Page(loop, panel, name=SCRIPT) as page:
        assert page.take_control()
        assert page.wait("control", lambda m: m["holder"] is not None)["holder"]["name"] == SCRIPT
        page.send(t="release_control")


def test_a_page_that_falls_silent_is_let_go_and_loses_control(loop, panel):
    with Page(loop, panel) as page, Page(loop, panel) as other:
        assert page.take_control()
        page.is_silent = True
        assert other.wait("control", lambda m: m["holder"] is None)["asked"] is None
        assert eventually(lambda: page.closed is not None)


def test_taking_over_asks_and_is_shown_to_both(loop, panel):
    with Page(loop, panel, name="one") as one, Page(loop, panel, name="two") as two, Page(
            loop, panel, token=None) as third:
        assert one.take_control()
        answer = two.ask("take_control")
        assert not answer["ok"] and answer["pending"]
        for page in (one, two, third):
            shown = page.wait("control", lambda m: m["asked"] is not None)
            assert shown["holder"]["name"] == "one" and shown["asked"]["name"] == "two"
        one.send(t="answer_control", give=False)
        assert two.wait("error")["code"] == "control_refused"
        assert two.ask("take_control")["pending"]
        one.send(t="answer_control", give=True)
        assert two.wait("control", lambda m: m["you"])["holder"]["name"] == "two"
        assert not one.wait("control", lambda m: m["holder"] and m["holder"]["name"] == "two")["you"]
        two.close()
        one.wait("control", lambda m: m["holder"] is None, since=len(one.messages) - 1)


def test_a_page_that_asked_and_goes_takes_nothing_from_the_one_that_has_control(loop, panel):
    with Page(loop, panel, name="one") as one:
        assert one.take_control() and one.command("jog_speed", None, fraction=0.05)["ok"]
        told, since = one.counts["jog_speed"], len(one.messages)
        with Page(loop, panel, name="two") as two:
            assert two.ask("take_control")["pending"]
            one.wait("control", lambda m: m["asked"] is not None, since=since)
        since = len(one.messages)
        assert one.wait("control", lambda m: m["asked"] is None, since=since - 1)["you"]
        assert one.counts["jog_speed"] == told, "the jog's speed is as it was: no hold was ended"


def test_read_only_passes_on_a_stop_and_nothing_else(loop, ros_node):
    with PanelProcess("--read-only", name="reader") as panel, Page(loop, panel) as page:
        assert page.welcome["may"] == "watch" and page.welcome["why"] == "read-only" and page.welcome["read_only"]
        assert not page.ask("take_control")["ok"] and not page.command("power", "/x", on=True)["ok"]
        assert page.ask("stop", arm=None)["ok"], "there is no arm: all of none have stopped"
