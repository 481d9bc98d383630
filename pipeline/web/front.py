"""Start page, its viewer and language, and the manual."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flask import Flask, Response, make_response, render_template, request

from .. import __version__
from ..report.format.language import LANGUAGES, load_translations
from .content import calibrating, choices
from .files.uploads import SENT_SUFFIXES
from .security import ENTRY, SESSION, RefusedError
from .state import PageState

VIEWER = Path(__file__).parents[1] / "report" / "static" / "viewer.js"
LANGUAGE_COOKIE = "wheelplane-language"
YEAR_S = 365 * 86400


def add_front(app: Flask, state: PageState) -> None:
    """Add the start page, for visitors with the session's cookie, and how they get that."""
    guard = state.guard

    @app.get("/")
    def first() -> Response:
        known = guard.knows(request.cookies.get(guard.cookie, ""))
        answer = make_response(_page(state)) if known else _entry(403)
        answer.headers["Cache-Control"] = "no-store"
        return answer

    @app.get(ENTRY)
    def enter() -> Response:
        return _entry(200)

    @app.post(SESSION)
    def session() -> Response:
        cookie = guard.exchange(str(given().get("token", "")))
        answer = Response(status=204)
        answer.set_cookie(guard.cookie, cookie, httponly=True, samesite="Strict")
        return answer

    @app.get("/viewer.js")
    def viewer() -> Response:
        return Response(VIEWER.read_bytes(), mimetype="text/javascript")

    @app.post("/api/language/<name>")
    def choose_language(name: str) -> Response:
        answer = Response(load_translations(name).language)
        answer.set_cookie(LANGUAGE_COOKIE, name, samesite="Strict", max_age=YEAR_S)
        return answer

    built: dict[str, bytes] = {}

    @app.get("/manual/")
    @app.get("/manual/<path:name>")
    def manual(name: str = "index.html") -> Response:
        from ..manual.build import pages

        if not built:
            built.update(pages())
        if name not in built:
            raise RefusedError(404, f"the manual has no page {name[:60]!r}")
        return Response(built[name], mimetype=choices.type_of(name))


def given() -> dict[str, Any]:
    """Return the JSON object of a request. Raises RefusedError."""
    try:
        found = request.get_json(silent=True)
    except RecursionError:
        raise RefusedError(400, "the request is nested too deep") from None
    if not isinstance(found, dict):
        raise RefusedError(400, "the request contains no JSON object")
    return found


def language() -> str:
    """Return the language chosen before, otherwise the one the browser prefers."""
    chosen = request.cookies.get(LANGUAGE_COOKIE, "")
    best = request.accept_languages.best_match(LANGUAGES) or "en"
    return chosen if chosen in LANGUAGES else best


def _entry(code: int) -> Response:
    """Return the page that shows the server the token in its address, or asks for it."""
    return make_response(render_template("enter.html", words=load_translations(language())), code)


def _page(state: PageState) -> str:
    words = load_translations(language())
    data = {
        "words": words.section("page"),
        "viewer": words.section("viewer"),
        "language": words.language,
        "machine": calibrating.choices(words),
        "limits": {
            "bytes": state.settings.upload_bytes,
            "suffixes": SENT_SUFFIXES,
            "kept": state.settings.results is not None,
        },
    }
    return render_template(
        "page.html",
        words=words,
        data=data,
        key=state.guard.key,
        languages=[load_translations(name) for name in LANGUAGES],
        choices=choices.known(state.settings.own),
        version=__version__,
    )
