"""Addresses of the page, each a call of the module that implements it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from flask import Flask, Response, g, jsonify, request
from werkzeug.exceptions import RequestedRangeNotSatisfiable
from werkzeug.wsgi import wrap_file

from ..files import lies_in
from ..report.format.language import load_translations
from ..report.json.stored import RECORD
from .archive import calibrations
from .archive import views as archive
from .content import choices
from .content.changes import changes
from .content.reporting import TYPES
from .files.folders import RESULTS, check_name, kind_of_file, kind_of_folder
from .front import given, language
from .jobs.process import PageJob
from .jobs.saving import report_file, save
from .security import RefusedError
from .state import PageState

SHOWN_FILES = (
    "measurement.json",
    "points.json",
    "points.bin",
    "comparison.json",
    "explanation.json",
)
SHOWN_KINDS = ("panel-", "scene-", "drawing-", "candidates-", "best-")


def add_files(app: Flask, state: PageState) -> None:
    """Add the addresses of allowed folders and uploads."""

    @app.get("/api/folders")
    def folders() -> Response:
        return jsonify(folders=[str(root) for root in state.folders.roots])

    @app.get("/api/files/<int:root>/")
    @app.get("/api/files/<int:root>/<path:relative>")
    def files(root: int, relative: str = "") -> Response:
        return jsonify(asdict(state.folders.listing(root, relative)))

    @app.post("/api/uploads")
    def begin() -> Response:
        return jsonify(upload=state.uploads.begin())

    @app.put("/api/uploads/<name>/<path:file>")
    def add(name: str, file: str) -> Response:
        state.uploads.add(name, file, request.stream, request.content_length)  # type: ignore[arg-type]
        return jsonify(stored=file)


def add_jobs(app: Flask, state: PageState) -> None:
    """Add the addresses of measurements, comparisons and their results."""

    @app.post("/api/measure")
    def measure() -> Response:
        asked = given()
        options = choices.checked(asked.get("options", {}), state.settings.own)
        with _source(state, asked) as (source, plan):
            kind = kind_of_folder(source) if source.is_dir() else kind_of_file(source)
            if kind == "measurement":
                job = state.jobs.start("open", plan["source"], plan | {"at": _place(asked)})
                return jsonify(job.public_state)
            kind = options.pop("read_as", None) or kind
            plan["kind"] = "five-point" if kind == "five-point" and source.is_file() else "capture"
            plan["options"] = options
            return jsonify(state.jobs.start("measure", plan["source"], plan).public_state)

    @app.post("/api/jobs/<name>/again")
    def again(name: str) -> Response:
        options = choices.checked(given().get("options", {}), state.settings.own)
        options.pop("read_as", None)
        return jsonify(state.jobs.again(state.jobs.found(name), options).public_state)

    @app.post("/api/jobs/<name>/explain")
    def explain(name: str) -> Response:
        return jsonify(state.jobs.explain(state.jobs.found(name), language()).public_state)

    @app.post("/api/compare")
    def compare() -> Response:
        asked = given()
        both = tuple(state.jobs.shown(str(asked.get(key))) for key in ("first", "second"))
        plan = {"folders": [str(job.folder) for job in both], "names": _names(both),
                "language": language()}  # fmt: skip
        return jsonify(
            state.jobs.start("compare", ", ".join(plan["names"]), plan, both).public_state
        )

    @app.get("/api/jobs")
    def measured() -> Response:
        running = state.jobs.running()
        return jsonify(
            jobs=[job.public_state for job in state.jobs.measured()],
            running=None if running is None else running.public_state,
        )

    @app.get("/api/jobs/<name>")
    def standing(name: str) -> Response:
        return jsonify(state.jobs.found(name).public_state)

    @app.post("/api/jobs/<name>/cancel")
    def cancel(name: str) -> Response:
        state.jobs.cancel(state.jobs.found(name))
        return jsonify(cancelled=name)

    @app.post("/api/jobs/<name>/remove")
    def remove(name: str) -> Response:
        state.jobs.remove(state.jobs.found(name))
        return jsonify(removed=name)

    @app.get("/api/jobs/<name>/<file>")
    def result(name: str, file: str) -> Response:
        job = state.jobs.shown(name)
        path = job.folder / file
        is_shown = file in SHOWN_FILES or file.startswith(SHOWN_KINDS)
        if not is_shown or not path.is_file() or not lies_in(path, job.folder):
            raise RefusedError(404, f"{file[:60]}: no such result")
        return _sent(path, choices.type_of(file))

    @app.get("/api/jobs/<name>/changes")
    def changed(name: str) -> Response:
        both = [state.jobs.shown(one) for one in (name, request.args.get("before", ""))]
        now, before = (job.folder / RECORD for job in both)
        return jsonify(table=changes(now, before, both[1].name, load_translations(language())))

    @app.get("/api/jobs/<name>/report.<kind>")
    def report(name: str, kind: str) -> Response:
        job, path = _report(state, name, kind, request.args)
        g.is_report = kind == "html"
        download_name = request.args.get("name") or f"{_stem(job)}.{kind}"
        check_name(download_name)
        answer = Response(path.read_bytes(), content_type=TYPES[kind])
        if "download" in request.args:
            answer.headers.set("Content-Disposition", "attachment", filename=download_name)
        return answer

    @app.post("/api/jobs/<name>/save")
    def keep(name: str) -> Response:
        asked = given()
        _, path = _report(state, name, str(asked.get("format")), asked)
        target = state.folders.free_name(
            _whole_number(asked.get("root")), str(asked.get("path", "")), str(asked.get("name", ""))
        )
        return jsonify(saved=save(path, target))


def _sent(path: Path, mimetype: str) -> Response:
    """Return a file, or the range of its bytes that is asked for, read as it is sent."""
    stream, size = path.open("rb"), path.stat().st_size
    content = wrap_file(request.environ, stream)
    answer = Response(content, mimetype=mimetype, direct_passthrough=True)
    answer.content_length = size
    try:
        answer.make_conditional(request.environ, accept_ranges=True, complete_length=size)
    except RequestedRangeNotSatisfiable:
        stream.close()
        raise
    return answer


@contextmanager
def _source(state: PageState, asked: dict[str, Any]) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Yield the path to be measured, and the part of the plan that locates it."""
    if "upload" in asked:
        with state.uploads.taken(str(asked["upload"])) as upload:
            source = upload.source
            yield source, _plan(source, source.parent) | {"owned": str(upload.folder.parent)}
    else:
        root = _whole_number(asked.get("root"))
        source = state.folders.existing(root, str(asked.get("path", "")))
        yield source, _plan(source, state.folders.roots[root])


def _plan(source: Path, allowed: Path) -> dict[str, Any]:
    """Return the plan of a source: `base`, the current folder of its process, and its name."""
    base = allowed.parent if source == allowed else allowed
    named = source.relative_to(base).as_posix()
    return {"base": str(base), "allowed": str(allowed), "source": named}


def _names(both: tuple[PageJob, ...]) -> list[str]:
    """Return the names of two measurements, with the time where they are the same."""
    if both[0].name != both[1].name:
        return [job.name for job in both]
    began = [time.localtime(job.began) for job in both]
    is_one_day = began[0][:3] == began[1][:3]
    form = "%H:%M:%S" if is_one_day else "%Y-%m-%d %H:%M:%S"
    return [f"{job.name}, {time.strftime(form, at)}" for job, at in zip(both, began, strict=True)]


def _place(asked: dict[str, Any]) -> str:
    """Return root and path of a source in an allowed folder, as in the page's address."""
    return "" if "upload" in asked else f"{asked.get('root')}/{asked.get('path', '')}"


def _whole_number(value: Any) -> int:
    return value if isinstance(value, int) else -1


def _report(state: PageState, name: str, kind: str, asked: Any) -> tuple[PageJob, Path]:
    job = state.jobs.shown(name)
    chosen = str(asked.get("language", language()))
    return job, report_file(state.jobs, job, kind, chosen, asked)


def _stem(job: PageJob) -> str:
    plain = "".join(c if c.isalnum() or c in " -_" else "-" for c in Path(job.name).stem)
    return plain.strip(" -")[:60] or "report"


def add_archive(app: Flask, state: PageState) -> None:
    """Add the addresses of batch results."""

    @app.get("/api/archive/<question>/<int:root>/")
    @app.get("/api/archive/<question>/<int:root>/<path:relative>")
    def ask(question: str, root: int, relative: str = "") -> Response:
        folder = _results(state, root, relative)
        parameters = request.args.to_dict()
        words = load_translations(language())
        return jsonify(archive.answer(question, folder, parameters, words))

    @app.get("/api/archive-plot/<int:root>/")
    @app.get("/api/archive-plot/<int:root>/<path:relative>")
    def plot(root: int, relative: str = "") -> Response:
        folder = _results(state, root, relative)
        svg = archive.plot(folder, request.args.to_dict(), load_translations(language()))
        return Response(svg, mimetype="image/svg+xml")

    @app.get("/api/archive-certificate/<int:root>/")
    @app.get("/api/archive-certificate/<int:root>/<path:relative>")
    def archived_certificate(root: int, relative: str = "") -> Response:
        folder = _results(state, root, relative)
        path = calibrations.certificate(folder, request.args.get("key", ""))
        inside = path.relative_to(folder).as_posix()
        found = state.folders.existing(root, f"{relative}/{inside}".lstrip("/"))
        g.is_report = True
        return Response(found.read_bytes(), content_type=TYPES["html"])


def _results(state: PageState, root: int, relative: str) -> Path:
    """Return a folder of results, refusing one with links to outside the allowed folder."""
    folder = state.folders.existing(root, relative)
    for name in [name for name in RESULTS if (folder / name).exists()] or RESULTS:
        state.folders.existing(root, f"{relative}/{name}".lstrip("/"))
    return folder
