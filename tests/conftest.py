"""One thread for linear algebra, as the command sets it: the same bytes, and no idle spinning."""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"
