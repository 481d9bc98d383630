"""File systems of fsspec without retries and caches of their own; meaning of their errors."""

from __future__ import annotations

import importlib
import os
from typing import Any

from ...errors import InputError, MissingDependencyError

TIMEOUTS_S = {"connect_timeout": 10, "read_timeout": 60}
FINAL = (FileNotFoundError, FileExistsError, PermissionError, IsADirectoryError, NotADirectoryError)
TAKEN = {"PreconditionFailed", "412"}
UNKNOWN = {"NotImplemented", "501"}
# a header has no code but its status: 400 of an expired token, of keys of another region
REFUSED = {"400", "AuthorizationHeaderMalformed", "InvalidToken", "InvalidBucketName"}
PACKAGES = {"s3": "wheelplane[storage]", "s3a": "wheelplane[storage]", "gs": "gcsfs"}
PACKAGES |= {"gcs": "gcsfs", "az": "adlfs", "abfs": "adlfs", "abfss": "adlfs"}


def file_system(url: str) -> Any:
    """Open the file system of a URL. Raises InputError, MissingDependencyError."""
    protocol = url.partition("://")[0].lower()
    package = PACKAGES.get(protocol, "wheelplane[storage]")
    if any(os.environ.get(k) for k in ("AWS_ENDPOINT_URL", "AWS_ENDPOINT_URL_S3")):
        # servers other than Amazon's may not support the newer checksums
        os.environ.setdefault("AWS_REQUEST_CHECKSUM_CALCULATION", "when_required")
        os.environ.setdefault("AWS_RESPONSE_CHECKSUM_VALIDATION", "when_required")
    own = {"config_kwargs": TIMEOUTS_S | {"retries": {"max_attempts": 0}}}
    try:
        fsspec: Any = importlib.import_module("fsspec")
        fs = fsspec.filesystem(
            protocol,
            use_listings_cache=False,
            skip_instance_cache=True,
            **(own if protocol in ("s3", "s3a") else {}),
        )
    except ImportError as error:
        raise MissingDependencyError(
            f"{url}: {protocol}:// needs a package: run pip install '{package}'"
        ) from error
    except ValueError as error:
        raise InputError(f"{url}: {protocol}:// is unknown: use s3://, gs:// or az://") from error
    if hasattr(fs, "retries"):
        fs.retries = 1
    return fs


def is_transient(error: Exception) -> bool:
    """Return whether the same request may succeed a little later."""
    kind = type(error).__name__
    if isinstance(error, FINAL) or code_of(error) in TAKEN | UNKNOWN | REFUSED:
        return False
    if is_redirected(error):
        return False
    return not isinstance(error, (TypeError, ValueError)) and "Credential" not in kind


def is_redirected(error: BaseException | None) -> bool:
    """Return whether the server answers each request by a redirection, to itself or nowhere.

    botocore follows a 301 without an address by calling itself, aiohttp others up to a limit.
    """
    while error is not None:
        if isinstance(error, RecursionError) or type(error).__name__ == "TooManyRedirects":
            return True
        error = error.__cause__ or error.__context__
    return False


def code_of(error: BaseException) -> str:
    """Return the error code of the server's response; empty if there is none."""
    answer = getattr(error.__cause__ or error, "response", None) or {}
    return str(answer.get("Error", {}).get("Code", ""))
