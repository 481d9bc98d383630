"""Results that outlive the program: each in a folder of its own, with what the page knows of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ...report.write import write_whole
from .process import PageJob

FILE, SCHEMA = "result.json", "wheelplane/page-result/1"
FACTS = {"name": str, "began": float, "note": str, "vehicle": str, "date": str}


def keep(job: PageJob) -> None:
    """Write what the page knows of a result beside it."""
    facts = {key: getattr(job, key) for key in FACTS}
    text = json.dumps({"schema": SCHEMA, **facts}, ensure_ascii=False, indent=1)
    write_whole(job.folder / FILE, text.encode(errors="backslashreplace"))


def kept_jobs(folder: Path) -> list[PageJob]:
    """Return the results in a folder, the oldest first; what is no result is left alone."""
    found = [_kept(path.parent) for path in folder.glob(f"*/{FILE}")]
    return sorted(filter(None, found), key=lambda job: (job.began, job.id))


def _kept(folder: Path) -> PageJob | None:
    try:
        tree = json.loads((folder / FILE).read_bytes())
        facts = {key: _checked(tree, key) for key in FACTS} if tree["schema"] == SCHEMA else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    if facts is None:
        return None
    for report in folder.glob("report-*"):  # by the version and the settings of that time
        report.unlink(missing_ok=True)
    job = PageJob(folder.name, "measure", facts.pop("name"), folder, plan={"discarded": True})
    vars(job).update(facts, state="done", kept=True)
    job.finished.set()
    return job


def _checked(tree: dict[str, Any], key: str) -> Any:
    value = tree[key]
    if not isinstance(value, FACTS[key]):
        raise TypeError(key)
    return value
