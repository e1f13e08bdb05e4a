"""The access to the panel: Host, Origin, token, limits, files; each attack is tried and its answer checked."""
import contextlib
import json
import os
import re
import socket
import ssl
from pathlib import Path

import aiohttp
import pytest
from import_graph import ROOT
from panel_page import Page, PanelProcess, get, refused
from strangers import context, half_of_a_hello
from tls_proxy import TlsProxy
from waiting import WAIT, eventually

LOGGED = 100000
"""Bytes in the log, at most, for 300 requests that are none; a traceback for each were a million."""
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
    "user@127.0.0.1:{port}", "127.0.0.1:{port}/x", "127.0.0.1#evil.example", "127.0.0.1?evil.example",
    "127.0.0.1:{port}#x", "127.0.0.1\\evil.example", "127.0.0.1;x", "127.0.0.1 evil.example", "127.0.0.1:0",
    "127.0.0.1:99999", "127.0.0.1:", "[::1", "::1", "127.0.0.1, evil.example", ""])
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


PATH = b"GET %s HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"


@pytest.mark.parametrize("request_bytes, statuses", [
    (b"GET\n\r\n\r\n", {400}), (b"\x16\x03\x01\x00\r\n\r\n", {400}), (b"GET / HTTP/9.9\r\n\r\n", {400, 403}),
    (PATH % (b"/web/" + b"a" * 6000), {400, 404, 414}), (PATH % (b"/web/" + b"a" * 300 + b".js"), {404}),
    (PATH % (b"/web/" + b"a/" * 1500 + b"b.js"), {404}), (PATH % (b"/mesh?arm=/x&uri=" + b"a" * 3000), {404}),
    (PATH % b"http://[x", {400, None}), (PATH % b"*", {400, 404}),
    (b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: x\r\n\r\n", {400}),
    (b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + b"X: " + b"y" * 9000 + b"\r\n\r\n", {400, 431}),
    (b"GET /ws HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://127.0.0.1\r\n\r\n", {400}),
    (b"\xff\xfe / HTTP/1.1\r\nHost: \xff\r\n\r\n", {400, 403})], ids=lambda value: str(value)[:40])
def test_a_malformed_request_gets_a_short_answer_that_says_nothing_of_the_server(panel, request_bytes, statuses):
    head = raw_answer(panel, request_bytes)
    assert (int(head.split()[1]) if head else None) in statuses, head
    assert not head or "Content-Security-Policy" in head and "nosniff" in head and "X-Frame-Options: DENY" in head
    assert "aiohttp" not in head and "Python" not in head
    assert "Traceback" not in "".join(panel.said)


def raw_answer(panel, data):
    """Return the head of what the panel answers to these bytes."""
    with socket.create_connection(("127.0.0.1", panel.port), WAIT) as link:
        link.settimeout(WAIT)
        link.sendall(data)
        answer = b""
        while b"\r\n\r\n" not in answer:
            more = b""
            with contextlib.suppress(ConnectionError):
                more = link.recv(1 << 16)
            if not more:
                break
            answer += more
        return answer.partition(b"\r\n\r\n")[0].decode("latin-1")


def test_requests_that_are_none_fill_no_log(panel):
    def logged():
        folder = Path(os.environ["ROS_LOG_DIR"])
        return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) + len("".join(panel.said))
    before = logged()
    for _ in range(300):
        raw_answer(panel, b"GET\n\r\n\r\n")
    assert logged() - before < LOGGED, "bytes"


def descriptors(panel):
    return len(os.listdir("/proc/%d/fd" % panel.process.pid))


def test_connections_that_ask_nothing_are_few_and_keep_nobody_out(loop, panel):
    before = descriptors(panel)
    with contextlib.ExitStack() as links:
        for _ in range(300):
            link = links.enter_context(socket.create_connection(("127.0.0.1", panel.port), WAIT))
            with contextlib.suppress(ConnectionError):
                link.sendall(b"GET / HTTP/1.1\r\nHost: 127")
        assert eventually(lambda: descriptors(panel) < before + 150)
        assert get(loop, panel, "/api/stop", "POST", Origin="http://127.0.0.1:%d" % panel.port,
                   Authorization="Bearer " + panel.token, **{"Content-Length": "0"})[0] == 200
        with Page(loop, panel) as page:
            assert page.welcome["may"] == "command"


def test_visitors_have_a_place_of_their_own_and_none_of_the_others(loop, panel):
    with contextlib.ExitStack() as pages:
        first = pages.enter_context(Page(loop, panel, token=None))
        second = pages.enter_context(Page(loop, panel, token=None, hello=False))
        assert eventually(lambda: second.closed is not None) and second.closed == 1013
        for _ in range(3):
            assert pages.enter_context(Page(loop, panel)).welcome["may"] == "command"
        assert first.closed is None


@pytest.mark.parametrize("data", [
    b"\x89\x80" + bytes(4), b"\x8a\x80" + bytes(4), b"\x01\x80" + bytes(4) + b"\x00\x80" + bytes(4),
    b"\x01\xfe\x40\x00" + bytes(4 + 0x4000) + 7 * (b"\x00\xfe\x40\x00" + bytes(4 + 0x4000))],
    ids=["ping", "pong", "fragments", "a message without end"])
@pytest.mark.parametrize("token", [None, True], ids=["visitor", "token"])
@pytest.mark.parametrize("served_by", ["panel", "secret"], ids=["clear", "TLS"])
def test_frames_of_any_kind_beyond_the_share_end_the_connection(loop, request, served_by, token, data):
    panel = request.getfixturevalue(served_by)
    with Page(loop, panel, token=token) as page, Page(loop, panel) as other:
        page.write(data * (1 if len(data) > 1000 else 2000))
        assert eventually(lambda: page.closed is not None)
        before = other.counts.get("pong", 0)
        other.send(t="ping", clock=1.0)
        assert eventually(lambda: other.counts.get("pong", 0) > before) and other.closed is None


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


HUGE = "9" * 400
JOG = {"t": "jog", "arm": "/x", "hold": 1, "seq": 1, "clock": 1.0, "echo": 1.0, "space": "joint",
       "v": [1.0] + [0.0] * 5, "step": None}


@pytest.mark.parametrize("message, fields", [
    ({"t": "ping", "clock": 0, "echo": 0, "seen": 0}, ("clock", "echo", "seen")),
    ({"t": "watch", "arms": [], "rate": 0}, ("arms", "rate")),
    ({"t": "history", "id": 0, "arm": "/x", "from": 0, "to": 0, "buckets": 0, "what": "q"},
     ("id", "from", "to", "buckets", "what")),
    (JOG, tuple(JOG)), (dict(JOG, v=[0]), ("v",)), ({"t": "jog_stop", "hold": 0}, ("hold",)),
    ({"t": "stop", "id": 0, "arm": None}, ("id", "arm")), ({"t": "take_control", "id": 0}, ("id",)),
    ({"t": "cmd", "id": 0, "arm": None, "cmd": "jog_speed", "args": {"fraction": 0}}, ("id", "arm", "cmd", "args")),
    ({"t": "hello", "v": 0}, ("t", "v"))], ids=lambda value: str(value)[:40])
def test_numbers_of_any_size_in_any_field_change_nothing(loop, panel, message, fields):
    texts = []
    for field in fields:
        value = message[field]
        place = [HUGE] if isinstance(value, list) else {"fraction": HUGE} if isinstance(value, dict) else HUGE
        for sign in ("", "-"):
            texts.append(json.dumps(dict(message, **{field: place})).replace('"%s"' % HUGE, sign + HUGE))
        texts.append(json.dumps(dict(message, **{field: place})).replace('"%s"' % HUGE, "[" * 490 + "]" * 490))
    with Page(loop, panel) as page:
        assert page.take_control()
        for text in texts:
            page.send(text)
        before = page.counts.get("pong", 0)
        page.send(t="ping", clock=1.0)
        assert eventually(lambda: page.counts.get("pong", 0) > before) and page.closed is None
        page.send(t="release_control")
    assert "Traceback" not in "".join(panel.said)


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


async def talk(address, token):
    """Ask for the arms, stop, and open a page with the token and one without; return the answers and both welcomes."""
    async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(ssl=False)) as session:
        async with session.get(address + "api/info") as answer:
            info = await answer.json()
        headers = {"Origin": address.rstrip("/"), "Authorization": "Bearer " + token}
        async with session.post(address + "api/stop", headers=headers) as answer:
            stopped = await answer.json()
        welcomes = []
        for given in (token, None):
            async with session.ws_connect(address + "ws", headers=headers, protocols=(
                    "jaka-panel.v1", "token.%s" % given)) as page:
                await page.send_json({"t": "hello", "v": 1, "token": given, "name": "x"})
                welcomes.append(await page.receive_json())
        return info, stopped, welcomes


@pytest.fixture(scope="module")
def secret(ros_node, certificate, tmp_path_factory):
    (cert, key), folder = certificate, tmp_path_factory.mktemp("secret")
    with PanelProcess("--tls-cert", cert, "--tls-key", key, "--pages", "3", "--cell-data", str(folder / "cell.json"),
                      name="secret") as panel:
        panel.folder = folder
        yield panel


def test_with_tls_everything_is_served_too(loop, secret):
    assert secret.address.startswith("https://")
    info, stopped, welcomes = loop.run(talk(secret.address, secret.token))
    assert info["arms"] == [] and stopped["ok"]
    assert [welcome["may"] for welcome in welcomes] == ["command", "watch"]


def test_with_tls_files_come_whole_and_large_messages_both_ways(loop, secret):
    async def fetch(path):
        async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(ssl=False)) as session, session.get(
                secret.address + path) as answer:
            return answer.status, await answer.read()
    largest = max((ROOT / "tools/jaka_panel/web").rglob("*.js"), key=lambda path: path.stat().st_size)
    name = largest.relative_to(ROOT / "tools/jaka_panel").as_posix()
    assert loop.run(fetch(name)) == (200, largest.read_bytes())
    with Page(loop, secret) as page:
        page.send(t="ping", clock=1.0, fill="x" * 60000)
        assert eventually(lambda: page.counts.get("pong"))
        page.send(t="cmd", id="y" * 60000, arm=None, cmd="none")
        assert page.wait("answer", lambda m: m["id"] == "y" * 60000)["message"] == "no such command"


@pytest.mark.parametrize("size", [1, 16])
def test_with_tls_a_request_that_comes_in_small_pieces_is_served(secret, size):
    """Send the records of TLS in pieces, with one byte of text in each of them."""
    incoming, outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
    tls = context().wrap_bio(incoming, outgoing)
    with socket.create_connection(("127.0.0.1", secret.port), WAIT) as link:
        def talk(step, *args):
            while True:
                try:
                    return step(*args)
                except ssl.SSLWantReadError:
                    send()
                    data = link.recv(1 << 16)
                    assert data, "the connection ends"
                    incoming.write(data)

        def send():
            data = outgoing.read()
            for at in range(0, len(data), size):
                link.sendall(data[at:at + size])
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        talk(tls.do_handshake)
        for letter in b"GET /api/info HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n\r\n" % secret.port:
            tls.write(bytes([letter]))
        send()
        assert talk(tls.read, 1 << 16).startswith(b"HTTP/1.1 200")


@pytest.mark.parametrize("data", [
    b"", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", b"\x16\x03\x01\xff\xff" + b"x" * 70000,
    b"\x16\x03\x01\x00\x01\x01" * 20000], ids=["nothing", "no TLS", "a record without end", "records without end"])
def test_what_is_no_handshake_ends_the_connection_and_nobody_elses(loop, secret, data):
    with Page(loop, secret) as page, socket.create_connection(("127.0.0.1", secret.port), WAIT) as link:
        link.settimeout(WAIT)
        with contextlib.suppress(ConnectionError):
            link.sendall(data)
            while link.recv(1 << 16):
                pass
        before = page.counts.get("pong", 0)
        assert eventually(lambda: page.counts.get("pong", 0) > before) and page.closed is None
    assert "Traceback" not in "".join(secret.said)


def test_handshakes_that_stop_half_way_are_few_end_in_time_and_push_nobody_off(loop, secret):
    before, half = descriptors(secret), half_of_a_hello()
    with Page(loop, secret) as page, contextlib.ExitStack() as links:
        for number in range(300):
            link = links.enter_context(socket.create_connection(("127.0.0.1", secret.port), WAIT))
            with contextlib.suppress(ConnectionError):
                link.sendall(half[:number])
        assert eventually(lambda: descriptors(secret) < before + 100)
        with Page(loop, secret) as late:
            assert late.welcome["may"] == "command"
        assert eventually(lambda: descriptors(secret) < before + 5), "they are waited for no longer"
        assert page.closed is None


def test_with_tls_nothing_is_left_of_connections_that_were_cut(secret):
    def held():
        return descriptors(secret), len(os.listdir("/proc/%d/task" % secret.process.pid))
    before = held()
    for _ in range(20):
        for token in (secret.token, "none"):  # served in one loop, and in the other
            with context().wrap_socket(socket.create_connection(("127.0.0.1", secret.port), WAIT)) as link:
                link.sendall(b"GET /api/info HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nAuthorization: Bearer %s\r\n\r\n" % (
                    secret.port, token.encode()))
    assert eventually(lambda: all(now <= then for now, then in zip(held(), before))), (held(), before)


def test_with_tls_a_change_of_the_cell_is_logged_with_the_address_of_its_browser(loop, secret):
    with Page(loop, secret) as page:
        page.send(t="cell")
        revision = page.wait("cell", lambda m: not m["problem"])["revision"]
        change = {"section": "points", "arm": "/x", "name": "P", "entry": {"q": [0.0] * 6}}
        assert page.command("cell_change", None, revision=revision, changes=[change])["ok"]
        port = page.own_port()
    lines = [json.loads(line) for line in (secret.folder / "cell.audit" / "audit-000000000001.jsonl").open()]
    assert lines[-1]["host"] == "127.0.0.1:%d" % port


def test_behind_a_proxy_with_tls_everything_is_served_to_its_own_pages(loop, ros_node, certificate):
    with TlsProxy(loop, *certificate) as proxy, PanelProcess(
            "--behind-tls", "localhost:%d" % proxy.port, "--pages", "3", name="behind") as panel:
        proxy.target = int(re.search(r"connects to http://127.0.0.1:([0-9]+)", "".join(panel.said)).group(1))
        assert panel.address == "https://localhost:%d/" % proxy.port
        info, stopped, welcomes = loop.run(talk(panel.address, panel.token))
        assert info["arms"] == [] and stopped["ok"]
        assert [welcome["may"] for welcome in welcomes] == ["command", "watch"]
        panel.port = proxy.target
        assert refused(loop, panel) == 403, "a page that came past the proxy"
        for name in ("localhost:%d" % proxy.port, "127.0.0.1:%d" % proxy.port):
            status, headers, _ = get(loop, panel, "/api/info", Host=name, Connection="keep-alive")
            assert (status, headers["connection"]) == (200, "close"), "no connection carries requests of two browsers"


def test_read_only_passes_on_a_stop_and_nothing_else(loop, ros_node):
    with PanelProcess("--read-only", name="reader") as panel, Page(loop, panel) as page:
        assert page.welcome["may"] == "watch" and page.welcome["why"] == "read-only" and page.welcome["read_only"]
        assert not page.ask("take_control")["ok"] and not page.command("power", "/x", on=True)["ok"]
        assert page.ask("stop", arm=None)["ok"], "there is no arm: all of none have stopped"
