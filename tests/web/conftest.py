"""Fixtures of the tests in a real browser: the browser, a served page, a tab."""

from __future__ import annotations

import pytest

from tests.support.browser import CHROMIUM, FLAGS, Visit, serving


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def address(folder, tmp_path_factory):
    with serving(folder, tmp_path_factory.mktemp("scratch")) as made:
        yield made


@pytest.fixture
def visit(browser, address, request):
    made = Visit(browser, address, **getattr(request, "param", {}))
    yield made
    made.context.close()
    assert made.faults == []
