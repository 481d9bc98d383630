"""Addresses of the calibration of a machine against a measurement."""

from __future__ import annotations

from pathlib import Path

from flask import Flask, Response, g, jsonify, request

from ..report.write import write_whole
from .content.calibrating import evaluate, references_of
from .content.calibration_files import Request, calibration_files, request_of
from .content.reporting import TYPES
from .files.folders import check_name
from .front import given, language
from .jobs.process import MEASURED, PageJob
from .jobs.saving import save_folder, table_rows
from .security import RefusedError
from .state import PageState

TABLES, TABLE_BYTES = (".csv", ".xlsx"), 16 << 20
CERTIFICATE = "certificate.html"


def add_calibrations(app: Flask, state: PageState) -> None:
    """Add the addresses of readings, what they show so far, and the saved calibration."""

    @app.post("/api/jobs/<name>/calibration")
    def calibration(name: str) -> Response:
        asked = request_of(given())
        return jsonify(evaluate(_folders(state, name, asked), asked, language()))

    @app.put("/api/jobs/<name>/readings/<file>")
    def readings(name: str, file: str) -> Response:
        job = _measured(state, name)
        check_name(file)
        if not file.lower().endswith(TABLES):
            raise RefusedError(415, f"{file[:100]}: not a table of readings: give CSV or XLSX")
        if request.content_length is None or request.content_length > TABLE_BYTES:
            raise RefusedError(413, f"{file[:100]}: larger than {TABLE_BYTES >> 20} MB")
        return jsonify(rows=table_rows(state.jobs, job, request.get_data(), file, language()))

    @app.post("/api/jobs/<name>/calibration/save")
    def save_calibration(name: str) -> Response:
        job, asked = _measured(state, name), given()
        root = asked.get("root")
        target = state.folders.free_name(
            root if isinstance(root, int) else -1,
            str(asked.get("path", "")),
            str(asked.get("name", "")),
        )
        config = state.settings.config
        entered = request_of(asked)
        references = references_of(_folders(state, name, entered))
        files = calibration_files(references, entered, config, language())
        saved = save_folder(files, target)
        write_whole(job.folder / CERTIFICATE, files[CERTIFICATE])
        return jsonify(saved=saved)

    @app.get(f"/api/jobs/<name>/{CERTIFICATE}")
    def certificate(name: str) -> Response:
        path = _measured(state, name).folder / CERTIFICATE
        if not path.is_file():
            raise RefusedError(404, "no certificate of this measurement: save the calibration")
        g.is_report = True
        return Response(path.read_bytes(), content_type=TYPES["html"])


def _folders(state: PageState, name: str, asked: Request) -> list[Path]:
    """Return the folders of the measurements that are the references of a request."""
    return [_measured(state, one).folder for one in (name, *asked.references)]


def _measured(state: PageState, name: str) -> PageJob:
    job = state.jobs.shown(name)
    if job.task not in MEASURED:
        raise RefusedError(400, "no measurement: a calibration needs the angles of one")
    return job
