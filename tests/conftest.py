"""One thread for linear algebra, as the command sets it: the same bytes, and no idle spinning.

No deadline for an example of hypothesis: how long it takes is no law.

SIGINT as in a terminal: a runner started in the background (nohup ... &) ignores it, and so would
every process that a test starts and interrupts.
"""

import os
import signal

from hypothesis import settings

settings.register_profile("wheelplane", deadline=None)
settings.load_profile("wheelplane")
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
