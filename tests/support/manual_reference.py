"""Generator of the manual's chapter of all commands, from click.

.venv/bin/python -m tests.support.manual_reference    writes pipeline/manual/18-commands.md
"""

from __future__ import annotations

import re
from pathlib import Path

import click

from wheelplane.cli import cli
from wheelplane.manual.build import chapter_files

NAME = "18-commands.md"
HEAD = """\
# All commands

Every command with all of its options, as printed by `--help`. `wheelplane --help` lists the
commands, `wheelplane --version` prints the version. For exit codes see
[Troubleshooting](16-troubleshooting.md#exit-codes).
"""


def chapter() -> str:
    """Return the text of the chapter."""
    context = click.Context(cli, info_name="wheelplane")
    parts = [HEAD]
    for name in cli.list_commands(context):
        command = cli.get_command(context, name)
        assert command is not None
        parts += _section(command, click.Context(command, context, info_name=name))
    return "\n".join(parts)


def commands() -> dict[str, click.Command]:
    """Return all commands by their full names, such as `wheelplane measure`."""
    context = click.Context(cli, info_name="wheelplane")
    found: dict[str, click.Command] = {}
    for name in cli.list_commands(context):
        command = cli.get_command(context, name)
        assert command is not None
        found |= _below(command, f"wheelplane {name}")
    return found


def _below(command: click.Command, path: str) -> dict[str, click.Command]:
    found = {path: command}
    if isinstance(command, click.Group):
        for name in sorted(command.commands):
            found |= _below(command.commands[name], f"{path} {name}")
    return found


def _section(command: click.Command, context: click.Context) -> list[str]:
    usage = context.command_path + " " + " ".join(command.collect_usage_pieces(context))
    parts = [f"## {context.command_path}\n", f"```text\n{usage}\n```\n", *_paragraphs(command.help)]
    rows = [_row(one, context) for one in command.params if isinstance(one, click.Option)]
    if rows:
        parts += ["| option | meaning |\n|---|---|", *rows, ""]
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            assert inner is not None
            parts += _section(inner, click.Context(inner, context, info_name=name))
    return parts


def _paragraphs(text: str | None) -> list[str]:
    found = []
    for part in re.split(r"\n\s*\n", (text or "").strip()):
        if "\b" in part:
            found.append("```text\n" + part.replace("\b", "").strip("\n") + "\n```\n")
        else:
            found.append(plain(" ".join(part.split())) + "\n")
    return found


def _row(option: click.Option, context: click.Context) -> str:
    names = ", ".join(option.opts)
    if option.secondary_opts:
        names += " / " + ", ".join(option.secondary_opts)
    metavar = option.make_metavar(context).replace("INTEGER RANGE", "N").replace("FLOAT RANGE", "X")
    value = "" if option.is_flag or option.count else f" {metavar}"
    words = [plain(option.help or "")]
    extra = option.get_help_extra(context)
    bounds = [text for text in (extra.get("default"), extra.get("range")) if text]
    if extra.get("default"):
        bounds[0] = f"default: {bounds[0]}"
    if bounds:
        words.append(f"({', '.join(bounds)})")
    shown = f"{names}{value}".replace("|", "\\|")
    return f"| `{shown}` | {' '.join(filter(None, words))} |"


def plain(text: str) -> str:
    """Escape all Markdown markup except code spans."""
    parts = text.split("`")
    parts[::2] = [re.sub(r"([*_<\[\]|])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


if __name__ == "__main__":
    target = chapter_files()[0].with_name(NAME)
    target.write_text(chapter(), encoding="utf-8")
    print(f"wrote {Path(target)}")
