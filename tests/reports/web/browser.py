"""A browser without a window that a test drives: real pointer and keys, and what the page asked for or complained of.

It speaks the DevTools protocol over two pipes, so that neither a driver nor a package is needed, only the browser.
"""

from __future__ import annotations

import json
import os
import select
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")
"""What a browser that speaks this protocol may be called."""
FLAGS = (
    "--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
    "--no-first-run", "--disable-extensions", "--disable-background-networking", "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND", "--force-device-scale-factor=1",
)  # fmt: skip
"""Options of the browser; the second last leaves it without a network."""
LAUNCH = (
    "import fcntl, os, sys; r, w = (fcntl.fcntl(int(x), fcntl.F_DUPFD, 10) for x in sys.argv[1:3]); "
    "os.dup2(r, 3); os.dup2(w, 4); os.execvp(sys.argv[3], sys.argv[3:])"
)
"""Puts the ends of the pipes where the browser looks for them."""
PATIENCE_S = 60.0
KEYS = {"ArrowRight": 39, "Tab": 9}


class BrowserError(Exception):
    """The browser has ended, is silent, or the page has thrown."""


def found() -> str | None:
    """Path of a browser, None where there is none."""
    return None if os.name == "nt" else next(filter(None, map(shutil.which, NAMES)), None)


class Tab:
    """A page that is open.

    Attributes:
        complaints: Errors of scripts, and what the page's own policy has refused.
        asked: Addresses that it has asked for.
        dialogs: Texts of dialogs that scripts have opened.
    """

    def __init__(self, to: int, fro: int) -> None:
        self.complaints: list[str] = []
        self.asked: list[str] = []
        self.dialogs: list[str] = []
        self._to, self._fro, self._number, self._rest, self._session = to, fro, 0, b"", ""
        self._loaded = False
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{domain}.enable")

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Have the browser do something; returns its answer."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._receive()
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise BrowserError(f"{method}: {answer['error']['message']}")
                return dict(answer["result"])

    def open(self, path: Path, width: int = 900, height: int = 900) -> None:
        """Open a file at a size [px], and wait until it is loaded."""
        self.size(width, height)
        self._loaded = False
        self.asked.clear()
        self.complaints.clear()
        self.send("Page.navigate", url=path.resolve().as_uri())
        while not self._loaded:
            self._receive()

    def size(self, width: int, height: int = 900) -> None:
        """Give the page a size [px]."""
        self.send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def ask(self, expression: str) -> Any:
        """Value of an expression in the page; its own policy does not hold for it."""
        answer = self.send("Runtime.evaluate", expression=expression, returnByValue=True)
        if "exceptionDetails" in answer:
            raise BrowserError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def place(self, query: str, across: float = 0.5, down: float = 0.5) -> tuple[float, float]:
        """Where an element is [px], after it was scrolled into view: a part of its width and height."""
        box = self.ask(
            f"(() => {{ const one = document.querySelector({json.dumps(query)}); "
            "one.scrollIntoView({block: 'center', behavior: 'instant'}); const b = one.getBoundingClientRect(); "
            "return [b.left, b.top, b.width, b.height]; })()"
        )
        return box[0] + across * box[2], box[1] + down * box[3]

    def point(self, x: float, y: float) -> None:
        """Move the pointer [px]."""
        self.send("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def click(self, x: float, y: float) -> None:
        """Click [px]."""
        self.point(x, y)
        for kind in ("mousePressed", "mouseReleased"):
            self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def press(self, key: str) -> None:
        """Press a key."""
        for kind in ("rawKeyDown", "keyUp"):
            self.send("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=KEYS[key])

    def _receive(self) -> dict[str, Any]:
        """The next message of the browser; events are noted."""
        end = monotonic() + PATIENCE_S
        while b"\0" not in self._rest:
            if not select.select([self._fro], [], [], max(end - monotonic(), 0.0))[0]:
                raise BrowserError(f"silent for {PATIENCE_S:g} s")
            more = os.read(self._fro, 1 << 16)
            if not more:
                raise BrowserError("it has ended")
            self._rest += more
        text, _, self._rest = self._rest.partition(b"\0")
        message: dict[str, Any] = json.loads(text)
        self._note(message.get("method", ""), message.get("params", {}))
        return message

    def _note(self, event: str, told: dict[str, Any]) -> None:
        if event == "Page.loadEventFired":
            self._loaded = True
        elif event == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(told["exceptionDetails"]))
        elif event == "Log.entryAdded" and told["entry"]["level"] in ("error", "warning"):
            self.complaints.append(told["entry"]["text"])
        elif event == "Network.requestWillBeSent":
            self.asked.append(told["request"]["url"])
        elif event == "Page.javascriptDialogOpening":
            self.dialogs.append(told["message"])


@contextmanager
def tab(browser: str, folder: Path) -> Iterator[Tab]:
    """A tab of a browser with a profile of its own in a folder; it ends with the block."""
    from_us, to_browser = os.pipe()
    from_browser, to_us = os.pipe()
    words = [sys.executable, "-c", LAUNCH, str(from_us), str(to_us), browser, *FLAGS, f"--user-data-dir={folder}"]
    with subprocess.Popen(words, pass_fds=(from_us, to_us), stderr=subprocess.DEVNULL) as process:
        os.close(from_us)
        os.close(to_us)
        try:
            yield Tab(to_browser, from_browser)
        finally:
            process.terminate()
            os.close(to_browser)
            os.close(from_browser)
