"""Environment of the processes that the program starts: stated, not inherited by chance.

Each also starts with PYTHONSAFEPATH or -P: the current folder, where the scans of others may lie,
is on no search path, neither of modules nor of programs nor of libraries.
"""

from __future__ import annotations

import os
import site
from pathlib import Path

# fmt: off
# Lists of folders; an empty or relative one stands for the current folder, or one in it.
SEARCH_PATHS = (
    "PATH", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "DYLD_FALLBACK_LIBRARY_PATH", "PYTHONPATH",
)
PASSED = {
    "HOME", "USER", "LOGNAME", "USERPROFILE", "LOCALAPPDATA", "SYSTEMROOT",
    "TMPDIR", "TEMP", "TMP", "LANG", "LANGUAGE", "TZ",
    "FONTCONFIG_FILE", "FONTCONFIG_PATH", "LD_PRELOAD",
    "PYTHONHOME", "PYTHONUSERBASE", "PYTHONNOUSERSITE", "PYTHONUTF8",
    "PYTHONDONTWRITEBYTECODE", "PYTHONPYCACHEPREFIX",
}
PASSED_GROUPS = (
    "LC_", "XDG_", "WHEELPLANE_",
    "GOMP_", "KMP_", "MKL_", "NPY_", "OMP_", "OPENBLAS_", "OPENCV_",
)
# For object storage: credentials, endpoints, proxies, certificates.
STORAGE = {
    "HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY", "NO_PROXY",
    "http_proxy", "https_proxy", "all_proxy", "no_proxy",
    "SSL_CERT_FILE", "SSL_CERT_DIR", "REQUESTS_CA_BUNDLE", "CURL_CA_BUNDLE",
    "STORAGE_EMULATOR_HOST",
}
STORAGE_GROUPS = (
    "AWS_", "AZURE_", "CLOUDSDK_", "FSSPEC_", "GCE_", "GCSFS_", "GOOGLE_", "IDENTITY_", "MSI_",
)
# fmt: on
# The same bytes with any number of cores.
STATED = {"PYTHONSAFEPATH": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
PACKAGE_PARENT = str(Path(__file__).absolute().parents[3])


def child_environment(*, storage: bool = False, **stated: str) -> dict[str, str]:
    """Return the environment of a process of ours.

    storage: it reads or writes object storage, and gets its credentials. stated: further variables.
    """
    names = PASSED | STORAGE if storage else PASSED
    groups = PASSED_GROUPS + STORAGE_GROUPS if storage else PASSED_GROUPS
    passed = {k: v for k, v in os.environ.items() if k in names or k.startswith(groups)}
    return passed | search_paths() | STATED | stated


def search_paths() -> dict[str, str]:
    """Return the search paths that are set, without the current folder; modules: ours first."""
    given = {name: os.environ.get(name, "").split(os.pathsep) for name in SEARCH_PATHS}
    if PACKAGE_PARENT not in (*site.getsitepackages(), site.getusersitepackages()):
        given["PYTHONPATH"].insert(0, PACKAGE_PARENT)
    absolute = {
        name: [f for f in folders if Path(f).is_absolute()] for name, folders in given.items()
    }
    return {name: os.pathsep.join(folders) for name, folders in absolute.items() if folders}
