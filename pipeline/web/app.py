"""Flask application of the page: checks of every request, headers of every response."""

from __future__ import annotations

import re
from collections.abc import Mapping

from flask import Flask, Response, current_app, g, jsonify, request
from werkzeug.exceptions import HTTPException
from werkzeug.http import parse_cookie

from ..errors import WheelplaneError
from .calibrations import add_calibrations
from .front import add_front
from .routes import add_archive, add_files, add_jobs
from .security import Guard, RefusedError, response_headers
from .settings import PageSettings
from .state import PageState

REQUEST_BYTES = 100_000  # of every request but an upload, and the readings of a calibration
READINGS_BYTES = 1_000_000
READINGS_PATH = re.compile(r"/api/jobs/\w+/calibration(/save)?")


def create_app(settings: PageSettings, guard: Guard) -> Flask:
    """Create the application; `app.config["state"].jobs.close()` ends the jobs it started."""
    app = Flask(__name__)
    state = PageState(settings, guard)
    app.config["state"] = state
    app.before_request(lambda: _check_request(state))
    app.after_request(_add_headers)
    app.register_error_handler(Exception, _error_response)
    for add in (add_front, add_files, add_jobs, add_calibrations, add_archive):
        add(app, state)
    return app


def admit(state: PageState, method: str, path: str, headers: Mapping[str, str]) -> None:
    """Raise RefusedError for a request whose body need not be received."""
    cookie = parse_cookie(headers.get("Cookie")).get(state.guard.cookie, "")
    state.guard.check(method, path, headers, cookie)
    if int(headers.get("Content-Length") or 0) > _most_bytes(state, method, path):
        raise RefusedError(413, "the request is too large: give a larger --upload-limit")


def _check_request(state: PageState) -> None:
    cookie = request.cookies.get(state.guard.cookie, "")
    state.guard.check(request.method, request.path, dict(request.headers), cookie)
    request.max_content_length = _most_bytes(state, request.method, request.path)


def _most_bytes(state: PageState, method: str, path: str) -> int:
    if method == "PUT":
        return state.settings.upload_bytes
    return READINGS_BYTES if READINGS_PATH.fullmatch(path) else REQUEST_BYTES


def _add_headers(response: Response) -> Response:
    kind = {"report": g.get("is_report", False), "api": request.path.startswith("/api/")}
    for name, value in response_headers(**kind).items():
        response.headers.setdefault(name, value)
    return response


def _error_response(error: Exception) -> tuple[Response, int]:
    if isinstance(error, RefusedError):
        return jsonify(error=str(error)), error.code
    if isinstance(error, WheelplaneError):
        return jsonify(error=str(error)), 400
    if isinstance(error, HTTPException):
        return jsonify(error=f"{error.code} {error.name}"), error.code or 500
    current_app.logger.exception("internal error")
    return jsonify(error=f"internal error ({type(error).__name__}): please report it"), 500
