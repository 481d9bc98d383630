"""The child that reads damaged files, one after the other, and says of each what became of it.

    python -m tests.fuzzing.worker FIRST STOP SEED FOLDER TELLS

It writes 'begin I' and 'end I OUTCOME' to the descriptor TELLS; standard output and error are one
file, in which a reader must not leave a word.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path

from tests.fuzzing.judge import BrokenLawError, judge
from tests.fuzzing.mutations import Mutant, mutant
from tests.fuzzing.samples import samples

SECONDS, BYTES, PEAK_MB = 10.0, 2 << 30, 500.0


def main() -> None:
    first, stop, seed = map(int, sys.argv[1:4])
    tells = int(sys.argv[5])
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("error")
    pool = samples(Path(sys.argv[4]))
    with tempfile.TemporaryDirectory() as scratch:
        folder, temporary = Path(scratch) / "files", Path(scratch) / "temporary"
        folder.mkdir()
        temporary.mkdir()
        tempfile.tempdir = os.environ["TMPDIR"] = str(temporary)
        for index in range(first, stop):
            os.write(tells, f"begin {index}\n".encode())
            outcome = look(mutant(pool, index, seed), folder, temporary)
            os.write(tells, f"end {index} {json.dumps(outcome)}\n".encode())


def look(damaged: Mutant, folder: Path, temporary: Path) -> dict[str, object]:
    """Verdict, seconds and peak memory of one mutant."""
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew: proc(5)
    spoken, start = os.fstat(1).st_size, time.perf_counter()
    try:
        verdict = judge(damaged, folder)
    except BrokenLawError as broken:
        verdict = str(broken)
    except BaseException as error:  # whatever escapes is the finding, PanicException too
        verdict = f"escaped: {type(error).__name__}: {error} at {_where(error)}"
    seconds = time.perf_counter() - start
    sys.stdout.flush()
    sys.stderr.flush()
    peak = _peak_mb()
    left = [path.name for path in temporary.iterdir() if not path.name.startswith("pymp-")]
    if seconds > SECONDS:
        verdict = f"slow: {seconds:.1f} s, then {verdict}"
    elif peak > PEAK_MB:
        verdict = f"large: {peak:.0f} MB, then {verdict}"
    elif os.fstat(1).st_size != spoken:
        verdict = f"it spoke: {os.pread(1, 300, spoken)!r}, then {verdict}"
    elif left:
        verdict = f"left behind: {left[0]}, then {verdict}"
    return {"verdict": verdict, "seconds": round(seconds, 4), "peak_mb": peak}


def _where(error: BaseException) -> str:
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{Path(place.filename).name}:{place.lineno}"


def _peak_mb() -> float:
    """Of this process since the peak began anew, or of the largest child so far."""
    lines = Path("/proc/self/status").read_text().splitlines()
    own = next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
    return max(own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss) / 1024.0


if __name__ == "__main__":
    main()
