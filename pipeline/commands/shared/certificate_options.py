"""The certificate of `calibrate`: its options, and its files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import partial, wraps
from pathlib import Path
from typing import Any

import click

from ...calibration import Calibration, issue, load_certificate
from ...config import Config
from ...errors import InputError
from ...report.certificate import FORMS, certificate_files
from ...report.format.view import View
from ...report.signature import read_private_key, signature_of
from ...report.write import ReportFiles
from ...system import frozen
from .options import Command, added
from .reporting import report_options
from .view_options import language_option

OPTIONS = (
    click.option(
        "--certificate",
        "path",
        type=click.Path(path_type=Path, dir_okay=False),
        metavar="FILE",
        help="Certificate file (TOML): number, customer, dates, method and who authorises it; "
        "--template writes a form of it. Laboratory, standards and environment are of --config.",
    ),
    click.option(
        "--accept-overdue",
        "accepted",
        multiple=True,
        metavar="NAME",
        help="A [[standard]] that is used past its due date all the same; the certificate says so.",
    ),
    click.option(
        "--html/--no-html", default=True, help="Write the certificate, certificate.html, to DIR."
    ),
    click.option("--pdf", is_flag=True, help="Write certificate.pdf to DIR."),
    click.option(
        "--dcc",
        is_flag=True,
        help="Write certificate.xml to DIR, a Digital Calibration Certificate (DCC 3.3.0).",
    ),
    click.option(
        "--sign",
        "key",
        type=click.Path(path_type=Path, dir_okay=False),
        metavar="KEY",
        help="Private key (Ed25519, PEM) by which each file of the certificate is signed: "
        "FILE.sig; `verify` checks it.",
    ),
    language_option,
)


@frozen
class CertificateOptions:
    """How the certificate is written; config: of who issues it."""

    path: Path | None
    accepted: tuple[str, ...]
    html: bool
    pdf: bool
    dcc: bool
    key: Path | None
    language: str | None

    def check(self, output: Path | None) -> None:
        """Raise InputError for options that need a folder where none is named."""
        named = {
            "--certificate": self.path is not None,
            "--accept-overdue": bool(self.accepted),
            "--pdf": self.pdf,
            "--dcc": self.dcc,
            "--sign": self.key is not None,
        }
        if output is None and any(named.values()):
            name = next(name for name, given in named.items() if given)
            raise InputError(f"{name} without -o DIR: name the folder that the certificate goes to")

    def files(
        self, found: Calibration, config: Config, view: View, record: str
    ) -> dict[str, bytes]:
        """Return the files of the certificate by their names, signed where a key is named.

        record: calibration.json. Raises ConfigError, InputError, MissingDependencyError.
        """
        made = issue(found, load_certificate(self.path, config), self.accepted)
        options = report_options(config.report, self.language, view)
        wanted = ReportFiles(html=self.html, pdf=self.pdf)
        files = certificate_files(made, record, options, wanted, self.dcc)
        if self.key is None:
            return files
        if made.draft:
            raise InputError("--sign of a draft: complete the certificate, or leave out --sign")
        key = read_private_key(self.key, partial(_passphrase, self.key))
        content = {"calibration.json": record.encode(), **files}
        return files | {f"{name}.sig": signature_of(data, key) for name, data in content.items()}


def keep_signed(folder: Path, files: Mapping[str, bytes]) -> None:
    """Raise InputError where files that are not signed would replace one that is, or leave it.

    A form of the certificate that is not among `files` would stay as that of these.
    """
    for name in {**files, **dict.fromkeys(FORMS)}:
        if f"{name}.sig" not in files and (folder / f"{name}.sig").exists():
            raise InputError(
                f"{folder / name}: is signed, and would be replaced by one that is not, or "
                f"removed: give another folder, or all its forms and --sign; or remove {name}.sig"
            )


def _passphrase(path: Path) -> str:
    return str(click.prompt(f"Passphrase of {path}", hide_input=True, err=True))


def certificate_options(command: Command) -> Command:
    """Add the options of the certificate to a command, which takes them as `issuing`."""

    @wraps(command)
    def gathered(**given: Any) -> Any:
        own = {field.name: given.pop(field.name) for field in fields(CertificateOptions)}
        return command(issuing=CertificateOptions(**own), **given)

    return added(OPTIONS, gathered)
