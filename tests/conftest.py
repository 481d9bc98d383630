"""One thread for linear algebra, as the command sets it: the same bytes, and no idle spinning.

No deadline for an example of hypothesis: how long it takes is no law.

SIGINT and SIGHUP as in a terminal: a runner started in the background (nohup ... &) ignores them,
and so would every process that a test starts and interrupts.

--share K/N runs the K-th of N shares of the tests, as their names divide them; --cases K/N, of each
test of three cases or more, every N-th case from the K-th on.
"""

import os
import signal
import zlib
from collections import defaultdict

import pytest
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


SEVERAL = 3  # cases of a test, from which on --cases takes some of them


def pytest_addoption(parser):
    parser.addoption("--share", default="0/1", metavar="K/N")
    parser.addoption("--cases", default="0/1", metavar="K/N")


@pytest.hookimpl(trylast=True)  # of what -m and -k leave
def pytest_collection_modifyitems(config, items):
    share, shares = map(int, config.getoption("--share").split("/"))
    case, cases = map(int, config.getoption("--cases").split("/"))
    of_test = defaultdict(list)
    for item in items:
        of_test[item.nodeid.partition("[")[0]].append(item)
    kept = {
        item
        for several in of_test.values()
        for item in (several[case % cases :: cases] if len(several) >= SEVERAL else several)
        if zlib.crc32(item.nodeid.encode()) % shares == share % shares
    }
    config.hook.pytest_deselected(items=[item for item in items if item not in kept])
    items[:] = [item for item in items if item in kept]
