"""Start page, its viewer and language, and the manual."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flask import Flask, Response, redirect, render_template, request

from .. import __version__
from ..report.format.language import LANGUAGES, load_translations
from .content import choices
from .files.uploads import SENT_SUFFIXES
from .security import RefusedError
from .state import PageState

VIEWER = Path(__file__).parents[1] / "report" / "static" / "viewer.js"
LANGUAGE_COOKIE = "wheelplane-language"
YEAR_S = 365 * 86400


def add_front(app: Flask, state: PageState) -> None:
    """Add the addresses for visitors with the session's cookie; `/` sets that cookie."""

    @app.get("/")
    def first() -> Any:
        guard = state.guard
        cookie = request.cookies.get(guard.cookie, "")
        if not guard.admits(request.args.get("token", ""), cookie):
            raise RefusedError(403, "open the complete address that was printed, with its token")
        answer: Any = redirect("/") if "token" in request.args else Response(_page(state))
        answer.set_cookie(guard.cookie, guard.session, httponly=True, samesite="Strict")
        answer.headers["Cache-Control"] = "no-store"
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


def language() -> str:
    """Return the language chosen before, otherwise the one the browser prefers."""
    chosen = request.cookies.get(LANGUAGE_COOKIE, "")
    best = request.accept_languages.best_match(LANGUAGES) or "en"
    return chosen if chosen in LANGUAGES else best


def _page(state: PageState) -> str:
    words = load_translations(language())
    data = {
        "words": words.section("page"),
        "viewer": words.section("viewer"),
        "language": words.language,
        "limits": {"bytes": state.settings.upload_bytes, "suffixes": SENT_SUFFIXES},
    }
    return render_template(
        "page.html",
        words=words,
        data=data,
        key=state.guard.key,
        languages=[load_translations(name) for name in LANGUAGES],
        choices=choices.known(),
        version=__version__,
    )
