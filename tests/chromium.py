"""A headless Chromium for tests of pages: the system's own, driven by playwright."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import Any, Self

from playwright.sync_api import sync_playwright

COMMANDS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
OWN_SCHEMES = ("file:", "about:", "data:", "blob:")
AXE = Path(sys.prefix) / "browser" / "node_modules" / "axe-core" / "axe.min.js"
AXE_FINDINGS = """axe.run(document, {preload: false}).then(found => JSON.stringify(
    found.violations.map(violation => [violation.id, violation.impact, violation.nodes.map(node => node.html)])))"""
"""What axe finds in a page that has run `AXE`, as JSON."""

SMALL_TEXT = """(() => { const small = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (walk.nextNode()) {
        const owner = walk.currentNode.parentElement, box = owner.getBoundingClientRect();
        if (!walk.currentNode.textContent.trim() || !box.width || owner.closest('script, .hidden, tspan')) continue;
        const scale = owner.getScreenCTM ? owner.getScreenCTM().d : 1;
        const size = parseFloat(getComputedStyle(owner).fontSize) * Math.abs(scale || 1);
        if (size < 10.95) small.push([walk.currentNode.textContent.trim(), size]);
    }
    return JSON.stringify(small); })()"""
"""Texts that are shown less than eleven pixels high, but for exponents, as JSON."""


class Chromium:
    """One browser with one page, opened anew for each file; a context manager."""

    def __init__(self) -> None:
        installed = [path for name in COMMANDS if (path := shutil.which(name))]
        command = os.environ.get("CHROMIUM") or next(iter(installed), None)
        assert command is not None, "no Chromium is installed: apt-get install chromium, or set CHROMIUM"
        self._playwright = sync_playwright().start()
        self._browser = self._playwright.chromium.launch(executable_path=command, chromium_sandbox=False)
        self._context: Any = None
        self.problems: list[str] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._browser.close()
        self._playwright.stop()

    def open(self, file: Path, *, fragment: str = "", width: int = 1440, height: int = 900, dark: bool = False,
             script: bool = True) -> None:  # fmt: skip
        """Open a file and wait until it is loaded."""
        if self._context is not None:
            self._context.close()
        self._context = self._browser.new_context(
            viewport={"width": width, "height": height},
            color_scheme="dark" if dark else "light",
            java_script_enabled=script,
        )
        self.page = self._context.new_page()
        self.problems = []
        self.page.on("pageerror", lambda error: self.problems.append(str(error)))
        self.page.on("requestfailed", lambda request: self.problems.append(f"not loaded: {request.url}"))
        self.page.on("request", lambda request: self.problems.extend(
            [] if request.url.startswith(OWN_SCHEMES) else [f"request to {request.url}"]))  # fmt: skip
        self.page.goto(file.resolve().as_uri() + (f"#{fragment}" if fragment else ""), wait_until="load")

    def run(self, expression: str) -> Any:
        """Return the value of an expression of JavaScript, of a promise what it comes to."""
        return self.page.evaluate(expression)

    def until(self, expression: str) -> Any:
        """Wait until an expression is true, and return its value."""
        return self.page.wait_for_function(expression, timeout=60_000.0).json_value()

    def call(self, method: str, **parameters: Any) -> Any:
        """Return what a method of the browser's own protocol answers: what playwright has no name for."""
        session = self._context.new_cdp_session(self.page)
        try:
            return session.send(method, parameters)
        finally:
            session.detach()
