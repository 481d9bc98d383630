"""The page's application: what every request must bring, and what every answer says."""

from __future__ import annotations

from flask import Flask, Response, current_app, g, jsonify, request
from werkzeug.exceptions import HTTPException

from ..errors import WheelplaneError
from .front import add_front
from .routes import add_archive, add_files, add_jobs
from .security import Guard, RefusedError, response_headers
from .settings import Settings
from .state import State

REQUEST_BYTES = 100_000  # of every request but an upload


def create_app(settings: Settings, guard: Guard) -> Flask:
    """The application; `app.config["state"].jobs.close()` ends what it started."""
    app = Flask(__name__)
    state = State(settings, guard)
    app.config["state"] = state
    app.before_request(lambda: _admit(state))
    app.after_request(_dress)
    app.register_error_handler(Exception, _tell)
    for add in (add_front, add_files, add_jobs, add_archive):
        add(app, state)
    return app


def _admit(state: State) -> None:
    cookie = request.cookies.get(state.guard.cookie, "")
    state.guard.check(request.method, request.path, dict(request.headers), cookie)
    is_upload = request.method == "PUT"
    request.max_content_length = state.settings.upload_bytes if is_upload else REQUEST_BYTES


def _dress(response: Response) -> Response:
    kind = {"report": g.get("is_report", False), "api": request.path.startswith("/api/")}
    for name, value in response_headers(**kind).items():
        response.headers.setdefault(name, value)
    return response


def _tell(error: Exception) -> tuple[Response, int]:
    if isinstance(error, RefusedError):
        return jsonify(error=str(error)), error.code
    if isinstance(error, WheelplaneError):
        return jsonify(error=str(error)), 400
    if isinstance(error, HTTPException):
        return jsonify(error=f"{error.code} {error.name}"), error.code or 500
    current_app.logger.exception("a fault of the program")
    return jsonify(error=f"the program has a fault here ({type(error).__name__}): report it"), 500
