"""A served page and a tab of a real browser that shows it, with what goes wrong there."""

from __future__ import annotations

import json
import threading
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from wheelplane.web.app import admit, create_app
from wheelplane.web.listener import Listener
from wheelplane.web.security import ENTRY, Guard
from wheelplane.web.server import address_of, free_port
from wheelplane.web.settings import Endpoint, PageSettings

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
]
WCAG = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]
TARGET_PX = 24  # WCAG 2.2, 2.5.8
TIMEOUT_MS = 60_000
SMALL = {"width": 1000, "height": 700}

IN_A_BROWSER = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not CHROMIUM.exists(), reason=f"there is no {CHROMIUM}, the browser that these tests drive"
    ),
]


@contextmanager
def serving(folder, scratch, **settings):
    """The address, as it is printed, of a page that may open this folder."""
    with free_port("127.0.0.1", 0) as listening:
        guard = Guard(listening.getsockname()[1])
        settings = PageSettings(folders=(folder,), scratch=scratch, **settings)
        app = create_app(settings, guard)
        state = app.config["state"]
        server = Listener(app, listening, partial(admit, state), settings.upload_bytes)
        thread = threading.Thread(target=server.run)
        thread.start()
        yield address_of(Endpoint(), guard)
        server.stop()
        thread.join()
        state.jobs.close()
        server.close()


class Visit:
    """A tab, and what went wrong in it."""

    def __init__(self, browser, address, **options):
        self.context = browser.new_context(**{"locale": "en-GB", "viewport": SMALL} | options)
        self.context.set_default_timeout(TIMEOUT_MS)
        self.faults, self.printed = [], address
        self.address = f"{address.partition(ENTRY)[0]}/"
        self.known = (self.address, "blob:", "data:")
        self.refusal = None  # status of an answer that a test provokes
        self.context.on("page", self._watch)
        self.context.on("request", self._request)
        self.page = self.context.new_page()

    def _watch(self, page):
        page.on("console", self._console)
        page.on("pageerror", lambda error: self.faults.append(f"error: {error}"))
        page.on("dialog", lambda dialog: self.faults.append(f"dialog: {dialog.message}"))

    def _console(self, message):
        is_expected = self.refusal is not None and f"status of {self.refusal}" in message.text
        if message.type in ("error", "warning") and not is_expected:
            place = message.location.get("url", "")
            self.faults.append(f"{message.type}: {message.text} {place}")

    def _request(self, request):
        if not request.url.startswith(self.known):
            self.faults.append(f"request to {request.url}")

    def open(self, view=""):
        """Open the printed address, as at the start with that view."""
        self.page.goto(f"{self.printed}&{view}" if view else self.printed)
        self.page.wait_for_url(lambda url: ENTRY not in url)
        return self.page

    def measure(self, name):
        """Choose what is called so, measured before or not, and wait for its angles."""
        self.page.wait_for_selector("#browser .items")
        before = self.page.locator("#before button", has_text=name)
        chosen = before if before.count() else self.page.locator("#browser button", has_text=name)
        chosen.first.click()
        self.page.wait_for_selector("#result:not([hidden]) table.angles")
        return self.page

    def check_with_axe(self):
        from axe_playwright_python.sync_playwright import Axe

        options = {"runOnly": {"type": "tag", "values": WCAG}}
        found = Axe().run(self.page, options=options).response["violations"]
        reported = [
            (fault["id"], [node["html"][:200] for node in fault["nodes"]]) for fault in found
        ]
        assert reported == [], json.dumps(reported, indent=1)


def until(page, expression):
    """Wait for it to hold; the page's own policy forbids the browser's way, which is eval."""
    for _ in range(TIMEOUT_MS // 50):
        if page.evaluate(expression):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"never so: {expression}")


def when_done(change):
    """Route of a job's state that adds `change(job)` to a job which is done."""

    def answer(route):
        fetched = route.fetch()
        job = fetched.json()
        if job["state"] == "done":
            job |= change(job)
        route.fulfill(response=fetched, json=job)

    return answer
