"""A headless Chromium, driven over its DevTools protocol by a pipe: pages, real clicks and keys, pictures, faults.

The pipe needs no port and no library: messages are JSON, ended by a zero byte, on the file descriptors 3 and 4.
"""
import base64
import contextlib
import itertools
import json
import os
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Tuple

CHROMIUM = shutil.which("chromium-headless-shell") or shutil.which("chromium") or shutil.which("google-chrome")
PATIENCE_S = 30.0
OPTIONS = ("--headless", "--no-sandbox", "--remote-debugging-pipe", "--no-first-run", "--disable-dev-shm-usage",
           "--hide-scrollbars", "--disable-extensions", "--mute-audio", "--disable-background-networking",
           "--force-color-profile=srgb", "--enable-precise-memory-info")
WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
NO_WEBGL = ("--disable-gpu", "--disable-3d-apis", "--disable-software-rasterizer")
KEYS = {"Enter": ("Enter", 13, "\r"), " ": ("Space", 32, " "), "Escape": ("Escape", 27, ""), "Tab": ("Tab", 9, ""),
        "ArrowRight": ("ArrowRight", 39, ""), "Home": ("Home", 36, "")}
GONE = ("Inspected target navigated or closed", "Execution context was destroyed.",
        "Cannot find context with specified id")
"""Errors in which Chromium tells of a document that gives way to the next one while an expression is evaluated."""


class BrowserError(Exception):
    """A request that the browser refused, or a page's script that failed."""


class Browser:
    """A Chromium process with a profile of its own; ``open`` gives pages.

    Args:
        webgl: Draw in 3D, by software, which costs a core; else the page finds no WebGL.
        options: More command line.
    """

    def __init__(self, *options: str, webgl: bool = False) -> None:
        self._profile = tempfile.mkdtemp(prefix="chromium-")
        to_browser, self._write = os.pipe()
        self._read, from_browser = os.pipe()

        def place_pipes() -> None:  # by way of numbers that are neither 3 nor 4
            one, other = os.dup(to_browser), os.dup(from_browser)
            os.dup2(one, 3)
            os.dup2(other, 4)

        assert CHROMIUM is not None, "no Chromium here: tools/dev setup installs chromium-headless-shell"
        self.process = subprocess.Popen(
            [CHROMIUM, *OPTIONS, *(WEBGL if webgl else NO_WEBGL), "--user-data-dir=" + self._profile, *options,
             "about:blank"], preexec_fn=place_pipes, close_fds=False, stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        os.close(to_browser)
        os.close(from_browser)
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()
        self._answers: Dict[int, Dict[str, Any]] = {}
        self._arrived = threading.Condition()
        self._pages: Dict[str, Page] = {}
        self._reader = threading.Thread(target=self._listen, daemon=True)
        self._reader.start()

    def _listen(self) -> None:
        rest = b""
        while True:
            try:
                data = os.read(self._read, 1 << 20)
            except OSError:
                data = b""
            if not data:
                break
            *messages, rest = (rest + data).split(b"\0")
            for text in messages:
                message = json.loads(text.decode("utf-8"))
                with self._arrived:
                    if "id" in message:
                        self._answers[message["id"]] = message
                    else:
                        page = self._pages.get(message.get("sessionId", ""))
                        if page is not None:
                            page.take(message["method"], message.get("params", {}))
                    self._arrived.notify_all()
        with self._arrived:
            self._answers[0] = {}  # ended
            self._arrived.notify_all()

    def send(self, method: str, session: str = "", **parameters: Any) -> int:
        """Send a request; return its number."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        data = json.dumps(message).encode("utf-8") + b"\0"
        with self._lock:
            while data:
                try:
                    data = data[os.write(self._write, data):]
                except BrokenPipeError:
                    raise BrowserError("the browser has ended") from None
        return number

    def answer(self, number: int, timeout: Optional[float] = None) -> Dict[str, Any]:
        """Return the answer to the request of this number."""
        with self._arrived:
            if not self._arrived.wait_for(lambda: number in self._answers or 0 in self._answers,
                                          timeout or PATIENCE_S):
                raise BrowserError("the browser has not answered")
            answer = self._answers.pop(number, {"error": {"message": "the browser has ended"}})
        if "error" in answer:
            raise BrowserError(answer["error"]["message"])
        return dict(answer["result"])

    def call(self, method: str, session: str = "", **parameters: Any) -> Dict[str, Any]:
        return self.answer(self.send(method, session, **parameters))

    def wait_for(self, condition: Callable[[], Any], what: str, timeout: float = PATIENCE_S) -> None:
        """Wait for something that events of pages bring about."""
        with self._arrived:
            assert self._arrived.wait_for(condition, timeout), what

    def open(self, url: str = "about:blank", width: int = 1440, height: int = 900, **emulated: Any) -> "Page":
        """Open a page in a context of its own: it shares no storage with the others."""
        context = self.call("Target.createBrowserContext")["browserContextId"]
        target = self.call("Target.createTarget", url="about:blank", browserContextId=context)["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = Page(self, target, session)
        self._pages[session] = page
        page.prepare(width, height, **emulated)
        if url != "about:blank":
            page.go(url)
        return page

    def close(self) -> None:
        with contextlib.suppress(OSError, BrowserError):
            self.send("Browser.close")
        try:
            self.process.wait(5.0)
        except subprocess.TimeoutExpired:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait(PATIENCE_S)
        os.close(self._write)
        self._reader.join(PATIENCE_S)
        os.close(self._read)
        shutil.rmtree(self._profile, ignore_errors=True)

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()


class Page:
    """One tab.

    Attributes:
        complaints: Errors of scripts, of the content security policy, of requests; in order.
        expected: Parts of errors that the test brings about itself; those are no complaints, whenever they are told.
        is_crashed, is_closed: Its renderer has ended; the tab was closed.
        sent: (time.monotonic(), text) of each message that it gave to a WebSocket.
    """

    def __init__(self, browser: Browser, target: str, session: str) -> None:
        self.browser, self.target, self.session = browser, target, session
        self.complaints: List[str] = []
        self.expected: List[str] = []
        self.is_crashed = self.is_closed = False
        self.sent: List[Tuple[float, str]] = []

    def prepare(self, width: int, height: int, scale: float = 1.0, dark: bool = False, language: str = "en-GB",
                has_focus: bool = True) -> None:
        for domain in ("Page", "Runtime", "Log", "Network", "Inspector"):
            self.call(domain + ".enable")
        self.resize(width, height, scale)
        self.call("Emulation.setLocaleOverride", locale=language.replace("-", "_"))
        self.call("Network.setUserAgentOverride", userAgent="Mozilla/5.0 (X11; Linux x86_64) Chrome/140 Test",
                  acceptLanguage=language)
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme",
                                                           "value": "dark" if dark else "light"}])
        if has_focus:
            self.call("Emulation.setFocusEmulationEnabled", enabled=True)

    def call(self, method: str, **parameters: Any) -> Dict[str, Any]:
        return self.browser.call(method, self.session, **parameters)

    def send(self, method: str, **parameters: Any) -> int:
        """Send a request whose answer nobody waits for."""
        return self.browser.send(method, self.session, **parameters)

    def take(self, method: str, parameters: Dict[str, Any]) -> None:
        if method == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            self._complain(str(details.get("exception", {}).get("description", details["text"])))
        elif method == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self._complain("%(text)s %(url)s" % dict({"url": ""}, **parameters["entry"]))
        elif method == "Runtime.consoleAPICalled" and parameters["type"] == "error":
            parts = [part.get("value", part.get("description")) for part in parameters["args"]]
            self._complain(" ".join(map(str, parts)))
        elif method == "Network.webSocketFrameSent":
            self.sent.append((parameters["timestamp"], parameters["response"]["payloadData"]))
        elif method == "Inspector.targetCrashed":
            self.is_crashed = True

    def _complain(self, text: str) -> None:
        if not any(part in text for part in self.expected):
            self.complaints.append(text)

    def resize(self, width: int, height: int, scale: float = 1.0) -> None:
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale,
                  mobile=False)

    def go(self, url: str) -> None:
        self.go_without_waiting(url)
        self._until_it_stands("%s loads" % url)

    def go_without_waiting(self, url: str) -> None:
        """Open a document; its page may not have begun to load when this returns."""
        answer = self.call("Page.navigate", url=url)
        assert not answer.get("errorText"), "%s: %s" % (url, answer["errorText"])

    def load_again(self) -> None:
        """Load the page again, and wait until the new document stands in place of the old one."""
        self.evaluate("window.isTheOldDocument = true")
        self.call("Page.reload")
        self._until_it_stands("the page loads again")

    def _until_it_stands(self, what: str) -> None:
        self.until("!window.isTheOldDocument && document.readyState === 'complete' && location.href !== 'about:blank'",
                   what)

    def evaluate(self, expression: str) -> Any:
        """Return the value of an expression; a promise is awaited."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            details = result["exceptionDetails"]
            raise BrowserError(str(details.get("exception", {}).get("description", details["text"])))
        return result["result"].get("value")

    def until(self, expression: str, what: str = "", timeout: float = PATIENCE_S) -> Any:
        """Wait until an expression is true; return its value."""
        deadline = time.monotonic() + timeout
        while True:
            try:
                value = self.evaluate(expression)
            except BrowserError as error:
                if str(error) not in GONE:
                    raise
                value = None
            if value:
                return value
            assert time.monotonic() < deadline, "%s\n%s\n%s\n%s" % (
                what or expression, self.complaints, self.text("#toasts"),
                self.evaluate("JSON.stringify([document.body.dataset, document.body.className])"))
            time.sleep(0.02)

    def text(self, selector: str) -> str:
        return str(self.evaluate("document.querySelector(%s)?.textContent ?? ''" % json.dumps(selector)))

    def until_text(self, selector: str, part: str, timeout: float = PATIENCE_S) -> None:
        seen = "document.querySelector(%s)?.textContent ?? ''" % json.dumps(selector)
        self.until("(%s).includes(%s)" % (seen, json.dumps(part)),
                   "%r in %r, now %r" % (part, selector, self.text(selector)), timeout)

    def place(self, selector: str) -> List[float]:
        """Return the middle of an element once it is visible and stands still, px; scroll it into view first."""
        box = self.evaluate("""(async () => {
            let last = null;
            for (let look = 0; look < 100; look += 1) {
                const element = document.querySelector(%s);
                element?.scrollIntoView({block: 'center'});
                const box = element?.getBoundingClientRect();
                const middle = box?.width && box.height ? [box.x + box.width / 2, box.y + box.height / 2] : null;
                if (middle && last && Math.hypot(middle[0] - last[0], middle[1] - last[1]) < 0.5) return middle;
                last = middle;
                await new Promise((resolve) => setTimeout(resolve, 20));
            }
            return last;
        })()""" % json.dumps(selector))
        assert box is not None, "nothing to be seen of %r" % selector
        return list(box)

    def mouse(self, kind: str, x: float, y: float, buttons: int = 0) -> None:
        """Send a mouse event; kind: Pressed, Released, Moved."""
        button = "none" if kind == "Moved" else "left"
        self.call("Input.dispatchMouseEvent", type="mouse" + kind, x=x, y=y, button=button, buttons=buttons,
                  clickCount=1, pointerType="mouse")

    def click(self, selector: str) -> None:
        x, y = self.place(selector)
        self.mouse("Moved", x, y)
        self.mouse("Pressed", x, y, 1)
        self.mouse("Released", x, y)

    def press(self, selector: str) -> List[float]:
        """Press the mouse on an element and hold it; return where."""
        x, y = self.place(selector)
        self.mouse("Moved", x, y)
        self.mouse("Pressed", x, y, 1)
        return [x, y]

    def key(self, name: str, kind: str = "both", **more: Any) -> None:
        """Send a key event; kind: down, up, both."""
        code, number, text = KEYS[name]
        if kind != "up":
            self.call("Input.dispatchKeyEvent", type="keyDown", key=name, code=code, windowsVirtualKeyCode=number,
                      text=text, **more)
        if kind != "down":
            self.call("Input.dispatchKeyEvent", type="keyUp", key=name, code=code, windowsVirtualKeyCode=number)

    def type(self, selector: str, text: str) -> None:
        """Replace the text of a field."""
        self.evaluate("(() => { const field = document.querySelector(%s); field.focus(); field.select(); })()"
                      % json.dumps(selector))
        self.call("Input.insertText", text=text)

    def picture(self, path: Path, whole: bool = False, quality: Optional[int] = None) -> Path:
        """Save a screenshot, PNG, or with a quality JPEG or WebP by the path's ending."""
        kind = {".jpg": "jpeg", ".webp": "webp"}.get(path.suffix, "png")
        more = {} if quality is None or kind == "png" else {"quality": quality}
        data = self.call("Page.captureScreenshot", format=kind, captureBeyondViewport=whole, **more)["data"]
        path.write_bytes(base64.b64decode(data))
        return path

    def close(self) -> None:
        self.is_closed = True
        with contextlib.suppress(BrowserError):
            self.browser.call("Target.closeTarget", targetId=self.target)
