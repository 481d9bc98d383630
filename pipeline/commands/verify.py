"""`wheelplane verify`: a certificate against its schema, and against its signature."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import InputError
from ..report.dcc.xml import schema_faults
from ..report.signature import is_signed

FILE = click.Path(path_type=Path, dir_okay=False)


@click.command()
@click.argument("file", type=FILE)
@click.option(
    "--schema",
    type=click.Path(path_type=Path),
    metavar="FILE|DIR",
    help="Schema of a digital certificate: dcc.xsd, or the folder with it and all that it imports.",
)
@click.option("--key", type=FILE, metavar="FILE", help="Public key (Ed25519, PEM) of who signed.")
@click.option("--signature", type=FILE, metavar="FILE", help="Signature; by default FILE.sig.")
def verify(file: Path, schema: Path | None, key: Path | None, signature: Path | None) -> int:
    """Check a certificate: --schema, that a digital one is valid; --key, that it is signed.

    \b
    wheelplane verify certificate.xml --schema dcc-3.3.0
    wheelplane verify certificate.pdf --key laboratory.pub

    Exits with 1 where the file is not valid, was changed, or was signed by another key.
    """  # noqa: D301 - click's mark for lines as they stand is a backspace
    if schema is None and key is None:
        raise InputError("--schema or --key is needed: name the schema, or the public key")
    if signature is not None and key is None:
        raise InputError("--signature without --key: name the public key of who signed")
    if not file.is_file():
        raise InputError(f"{file}: no such file: check the path")
    passed = True
    if schema is not None:
        faults = schema_faults(file, schema)
        passed = not faults
        click.echo(f"{file}: {'valid' if passed else 'not valid'} by {schema}")
        for fault in faults:
            click.echo(f"  {fault}")
    if key is not None:
        mark = signature or file.with_name(f"{file.name}.sig")
        if is_signed(file, mark, key):
            click.echo(f"{file}: signed by the owner of {key}, and unchanged since")
        else:
            click.echo(
                f"{file}: the signature {mark} does not fit: the file was changed, or signed "
                f"by another key than {key}"
            )
            passed = False
    return 0 if passed else 1
