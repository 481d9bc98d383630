"""One thread for linear algebra, as the command sets it: the same bytes, and no idle spinning.

No deadline for an example of hypothesis: how long it takes is no law.

SIGINT and SIGHUP as in a terminal: a runner started in the background (nohup ... &) ignores them,
and so would every process that a test starts and interrupts.

--share K/N runs the K-th of N shares of the tests, as their names divide them.
"""

import os
import signal
import zlib

from hypothesis import settings

settings.register_profile("wheelplane", deadline=None)
settings.load_profile("wheelplane")
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"
for number, handler in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)


def pytest_addoption(parser):
    parser.addoption("--share", default="0/1", metavar="K/N")


def pytest_collection_modifyitems(config, items):
    share, number = map(int, config.getoption("--share").split("/"))
    kept = [item for item in items if zlib.crc32(item.nodeid.encode()) % number == share % number]
    config.hook.pytest_deselected(items=[item for item in items if item not in set(kept)])
    items[:] = kept
