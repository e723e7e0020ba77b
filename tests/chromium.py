"""A headless Chromium for tests of pages: spoken to over a pipe in its DevTools protocol, without any driver."""

from __future__ import annotations

import base64
import itertools
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
PATIENCE = 60.0
"""Seconds after which a browser that does not answer has failed the test."""


def find() -> str | None:
    """Return the command of an installed Chromium, or None."""
    return os.environ.get("CHROMIUM") or next((found for name in NAMES if (found := shutil.which(name))), None)


class Chromium:
    """One browser with one tab; a context manager that ends the process it began."""

    def __init__(self, profile: Path) -> None:
        command = find()
        assert command is not None, "no Chromium is installed: apt-get install chromium, or set CHROMIUM"
        to_read, self._write = os.pipe()
        self._read, to_write = os.pipe()

        def wired() -> None:  # the browser reads from file descriptor 3 and writes to 4
            os.dup2(to_read, 63), os.dup2(to_write, 64)
            os.dup2(63, 3), os.dup2(64, 4)

        flags = ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--remote-debugging-pipe",
                 "--no-first-run", "--disable-extensions", f"--user-data-dir={profile}")  # fmt: skip
        self._process = subprocess.Popen(
            [command, *flags, "about:blank"], preexec_fn=wired, close_fds=False,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(to_read), os.close(to_write)
        self._numbers = itertools.count(1)
        self._left = b""
        self._held = False
        self.events: list[dict[str, Any]] = []
        self._session: str | None = None
        targets = self.call("Target.getTargets")["targetInfos"]
        page = next(each["targetId"] for each in targets if each["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network"):
            self.call(f"{domain}.enable")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._write)
        self._process.terminate()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._read)

    def call(self, method: str, **parameters: Any) -> Any:
        """Return what a method of the protocol answers; events that come meanwhile are kept in `events`."""
        number = next(self._numbers)
        message: dict[str, Any] = {"id": number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._message()
            if answer.get("id") == number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]
            self.events.append(answer)

    def _message(self) -> dict[str, Any]:
        until = time.monotonic() + PATIENCE
        while b"\0" not in self._left:
            ready, _, _ = select.select([self._read], [], [], max(0.0, until - time.monotonic()))
            assert ready, "the browser does not answer"
            more = os.read(self._read, 1 << 20)
            assert more, "the browser has ended"
            self._left += more
        text, _, self._left = self._left.partition(b"\0")
        return dict(json.loads(text))

    def open(self, page: Path | str, *, fragment: str = "", width: int = 1440, height: int = 900, dark: bool = False,
             script: bool = True) -> None:  # fmt: skip
        """Open a file and wait until it is loaded."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Emulation.setScriptExecutionDisabled", value=not script)
        address = page if isinstance(page, str) else page.resolve().as_uri()
        for url in ("about:blank", address + (f"#{fragment}" if fragment else "")):
            self.events.clear()
            self.call("Page.navigate", url=url)
            while not any(each["method"] == "Page.loadEventFired" for each in self.events):
                self.events.append(self._message())

    def run(self, expression: str) -> Any:
        """Return the value of an expression of JavaScript, of a promise what it comes to."""
        found = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def until(self, expression: str) -> Any:
        """Wait until an expression is true, and return its value."""
        end = time.monotonic() + PATIENCE
        while not (found := self.run(expression)):
            assert time.monotonic() < end, f"never true: {expression}"
            time.sleep(0.01)
        return found

    def press(self, key: str) -> None:
        """Press a key that is no character, as ArrowRight or Tab."""
        codes: Mapping[str, int] = {
            "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40, "Home": 36, "End": 35, "PageUp": 33,
            "PageDown": 34, "Tab": 9,
        }  # fmt: skip
        for kind in ("rawKeyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=codes[key])

    def click(self, selector: str) -> None:
        """Click in the middle of the first element that a selector finds, scrolled into view."""
        box = self.run(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)}); e.scrollIntoView({{block: 'center'}});"  # noqa: E501
            " const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
        )
        self.mouse("mousePressed", *box), self.mouse("mouseReleased", *box)

    def mouse(self, kind: str, x: float, y: float) -> None:
        """Move or press the mouse at a place of the window, px."""
        self._held = kind == "mousePressed" or (kind == "mouseMoved" and self._held)
        button = "left" if self._held or kind == "mouseReleased" else "none"
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, clickCount=1)

    def screenshot(self, path: Path | str, *, whole: bool = False) -> None:
        """Write a picture of the window, or of the whole page."""
        found = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        Path(path).write_bytes(base64.b64decode(found["data"]))

    def pdf(self, path: Path | str) -> None:
        """Print the page into a file."""
        Path(path).write_bytes(base64.b64decode(self.call("Page.printToPDF", printBackground=True)["data"]))

    @property
    def problems(self) -> list[str]:
        """Errors of scripts, and requests that went anywhere but to files, since the page was opened."""
        self.run("0")
        found = [str(each["params"]) for each in self.events if each["method"] == "Runtime.exceptionThrown"]
        for each in self.events:
            if each["method"] == "Network.requestWillBeSent":
                url = each["params"]["request"]["url"]
                found += [] if url.startswith(("file:", "about:", "data:", "blob:")) else [f"request to {url}"]
            if each["method"] == "Network.loadingFailed":
                found.append(f"not loaded: {each['params'].get('errorText')}")
        return found
