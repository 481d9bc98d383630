"""The page's addresses: thin, each a call of the module that does it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from flask import Flask, Response, g, jsonify, request

from ..report.format.language import load_translations
from .content import archive, choices
from .content.reporting import TYPES
from .files.folders import kind_of_file
from .front import language
from .jobs.process import Job
from .jobs.saving import report_file, save
from .security import RefusedError
from .state import State

SHOWN_FILES = ("measurement.json", "points.bin", "comparison.json")
SHOWN_KINDS = ("panel-", "scene-", "drawing-")


def add_files(app: Flask, state: State) -> None:
    """What lies in the allowed folders, and what the page sends."""

    @app.get("/api/folders")
    def folders() -> Response:
        return jsonify(folders=[str(root) for root in state.folders.roots])

    @app.get("/api/files/<int:root>/")
    @app.get("/api/files/<int:root>/<path:relative>")
    def files(root: int, relative: str = "") -> Response:
        return jsonify(items=[asdict(item) for item in state.folders.listing(root, relative)])

    @app.post("/api/uploads")
    def begin() -> Response:
        return jsonify(upload=state.uploads.begin())

    @app.put("/api/uploads/<name>/<path:file>")
    def add(name: str, file: str) -> Response:
        state.uploads.add(name, file, request.stream, request.content_length)  # type: ignore[arg-type]
        return jsonify(stored=file)


def add_jobs(app: Flask, state: State) -> None:
    """Measuring, comparing, and what comes of it."""

    @app.post("/api/measure")
    def measure() -> Response:
        given = _given()
        options = choices.checked(given.get("options", {}))
        with _source(state, given) as (source, plan):
            kind = options.pop("read_as", None) or kind_of_file(source)
            plan["kind"] = "five-point" if kind == "five-point" and source.is_file() else "capture"
            plan["options"] = options
            return jsonify(state.jobs.start("measure", plan["source"], plan).told)

    @app.post("/api/compare")
    def compare() -> Response:
        given = _given()
        both = tuple(state.jobs.shown(str(given.get(key))) for key in ("first", "second"))
        plan = {"folders": [str(job.folder) for job in both], "names": [job.name for job in both],
                "language": language()}  # fmt: skip
        return jsonify(state.jobs.start("compare", ", ".join(plan["names"]), plan, both).told)

    @app.get("/api/jobs")
    def measured() -> Response:
        return jsonify(jobs=[job.told for job in state.jobs.measured()])

    @app.get("/api/jobs/<name>")
    def standing(name: str) -> Response:
        return jsonify(state.jobs.found(name).told)

    @app.post("/api/jobs/<name>/cancel")
    def cancel(name: str) -> Response:
        state.jobs.cancel(state.jobs.found(name))
        return jsonify(cancelled=name)

    @app.get("/api/jobs/<name>/<file>")
    def result(name: str, file: str) -> Response:
        job = state.jobs.shown(name)
        path = job.folder / file
        is_ours = file in SHOWN_FILES or file.startswith(SHOWN_KINDS)
        if not is_ours or not path.is_file():
            raise RefusedError(404, f"{file[:60]}: there is no such result")
        return Response(path.read_bytes(), mimetype=choices.type_of(file))

    @app.get("/api/jobs/<name>/report.<kind>")
    def report(name: str, kind: str) -> Response:
        job, path = _report(state, name, kind, request.args)
        g.is_report = kind == "html"
        called = request.args.get("name") or f"{_stem(job)}.{kind}"
        answer = Response(path.read_bytes(), content_type=TYPES[kind])
        if "download" in request.args:
            answer.headers.set("Content-Disposition", "attachment", filename=called)
        return answer

    @app.post("/api/jobs/<name>/save")
    def keep(name: str) -> Response:
        given = _given()
        _, path = _report(state, name, str(given.get("format")), given)
        place = state.folders.free_name(
            _whole_number(given.get("root")), str(given.get("path", "")), str(given.get("name", ""))
        )
        return jsonify(saved=save(path, place))


@contextmanager
def _source(state: State, given: dict[str, Any]) -> Iterator[tuple[Path, dict[str, Any]]]:
    """What is to be measured, and how its process is to find it."""
    if "upload" in given:
        with state.uploads.taken(str(given["upload"])) as upload:
            source = upload.source
            yield source, _plan(source, source.parent) | {"owned": str(upload.folder.parent)}
    else:
        root = _whole_number(given.get("root"))
        source = state.folders.existing(root, str(given.get("path", "")))
        yield source, _plan(source, state.folders.roots[root])


def _plan(source: Path, allowed: Path) -> dict[str, Any]:
    """base: the folder to stand in, from where the source has a name."""
    base = allowed.parent if source == allowed else allowed
    named = source.relative_to(base).as_posix()
    return {"base": str(base), "allowed": str(allowed), "source": named}


def _given() -> dict[str, Any]:
    """The table that a request holds."""
    given = request.get_json(silent=True)
    if not isinstance(given, dict):
        raise RefusedError(400, "the request holds no table")
    return given


def _whole_number(value: Any) -> int:
    return value if isinstance(value, int) else -1


def _report(state: State, name: str, kind: str, given: Any) -> tuple[Job, Path]:
    job = state.jobs.shown(name)
    chosen = str(given.get("language", language()))
    return job, report_file(state.jobs, job, kind, chosen, given.get("axis"), given.get("style"))


def _stem(job: Job) -> str:
    plain = "".join(c if c.isalnum() or c in " -_" else "-" for c in Path(job.name).stem)
    return plain.strip(" -")[:60] or "report"


def add_archive(app: Flask, state: State) -> None:
    """Results of a batch."""

    @app.get("/api/archive/<question>/<int:root>/")
    @app.get("/api/archive/<question>/<int:root>/<path:relative>")
    def ask(question: str, root: int, relative: str = "") -> Response:
        folder = _results(state, root, relative)
        asked = request.args.to_dict()
        return jsonify(archive.answer(question, folder, asked, load_translations(language())))

    @app.get("/api/archive-plot/<int:root>/")
    @app.get("/api/archive-plot/<int:root>/<path:relative>")
    def plot(root: int, relative: str = "") -> Response:
        folder = _results(state, root, relative)
        svg = archive.plot(folder, request.args.get("quantity", ""), load_translations(language()))
        return Response(svg, mimetype="image/svg+xml")


def _results(state: State, root: int, relative: str) -> Path:
    """A folder of results, none of which is a link to beyond the allowed folder."""
    state.folders.existing(root, f"{relative}/measurements".lstrip("/"))
    return state.folders.existing(root, relative)
