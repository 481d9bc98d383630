"""Store in object storage, by fsspec, with retries and conditional puts."""

from __future__ import annotations

import errno
import math
import os
import random
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any, TypeVar

from ...errors import InputError, WheelplaneError
from ...files import improper, path_below
from .entry import IMPROPER, PARTIAL, Entry
from .filesystem import TAKEN, code_of, file_system, is_redirected, is_transient

T = TypeVar("T")
FIRST_WAIT_S, TRIES = 0.2, 8  # 0.2 + 0.4 + ... = 25 s in all, +-50 %
CHECK_TRIES, CHECK_S = 3, 10.0  # of an address that may be mistyped
AWAY_S, NOTED_S = 1800.0, 60.0  # how long a patient store waits; seconds between its notes
UNKNOWN_HEADER = (errno.ENOSYS, errno.EINVAL)  # 501, 400


class RemoteStore:
    """Objects below a URL; picklable: each process opens its own connections."""

    local = None

    def __init__(self, url: str) -> None:
        self.url = url
        self._opened: tuple[int, Any] | None = None
        self._exclusive: bool | None = None
        self._note: Callable[[str], None] | None = None
        self._noted_s, self.back_s = -math.inf, 0.0

    def be_patient(self, note: Callable[[str], None] | None) -> None:
        """Wait up to AWAY_S for a server that does not answer TRIES tries, and note it."""
        self._note = note

    def __reduce__(self) -> tuple[type[RemoteStore], tuple[str]]:
        return type(self), (self.url,)

    def check(self) -> None:
        """Check that the bucket can be reached, and on S3 listed. Raises InputError."""
        fs, (bucket, _, prefix) = self._fs, self._path("").partition("/")

        def ask() -> None:
            if hasattr(fs, "call_s3"):  # a page: its error, unlike that of a header, has a code
                fs.call_s3("list_objects_v2", Bucket=bucket, Prefix=prefix, MaxKeys=1)
                return
            with suppress(FileNotFoundError):
                fs.info(self._path(f"{PARTIAL}/none"))

        try:
            self._try(ask, "", CHECK_TRIES, CHECK_S)
        except FileNotFoundError as error:
            fact = "no such bucket: create it first, or check the address of the storage"
            raise InputError(f"{self.url}: {fact}") from error
        except OSError as error:
            raise self._refused("", error) from error

    @property
    def exclusive(self) -> bool:
        """Whether the server honours If-None-Match, so that one of several writers wins.

        Tested once, by two conditional puts. If not, `write_new` checks before it writes: of two
        simultaneous writers the last one wins, which is harmless for equal contents.
        """
        if self._exclusive is None:
            probe = f"{PARTIAL}/{uuid.uuid4().hex}"
            try:
                self._exclusive = self._create(probe, b"1") and not self._create(probe, b"2")
            except OSError as error:
                if error.errno not in UNKNOWN_HEADER:
                    raise self._refused(probe, error) from error
                self._exclusive = False
            self.remove(probe)
        return self._exclusive

    def list(self, prefix: str = "") -> Iterator[Entry]:
        """Yield objects whose name begins with `prefix`, sorted; in pages of 1,000 on S3."""
        return (one for one in self.entries(self._listed(prefix)) if one.name.startswith(prefix))

    def entries(self, objects: Iterable[tuple[str, int, str]]) -> Iterator[Entry]:
        """Yield the entries of objects: BUCKET/KEY, size and stamp.

        One that cannot be copied to a folder by its name has the stamp IMPROPER.
        """
        skip = len(self._path(""))
        for path, size, stamp in objects:
            name = path[skip:]
            if not name.endswith("/") and _shown(name):
                yield Entry(name, size, stamp if improper(name) is None else IMPROPER)

    def names(self, prefix: str = "") -> Iterator[str]:
        """Yield the names of the same objects: a page of a listing holds all of each."""
        return (entry.name for entry in self.list(prefix))

    def _listed(self, prefix: str) -> Iterator[tuple[str, int, str]]:
        if hasattr(self._fs, "call_s3"):
            bucket, _, key = self._path(prefix).partition("/")
            request = {"Bucket": bucket, "Prefix": key}
            while request:
                page = self._request(lambda: self._fs.call_s3("list_objects_v2", **request), prefix)  # noqa: B023
                for found in page.get("Contents", ()):
                    yield f"{bucket}/{found['Key']}", found["Size"], found["ETag"].strip('"')
                token = page.get("NextContinuationToken")
                request = request | {"ContinuationToken": token} if token else {}
            return
        folder = self._path(prefix.rpartition("/")[0]).rstrip("/")
        found = self._request(lambda: self._fs.find(folder, detail=True), prefix, {})
        for path, info in sorted(found.items()):
            stamps = (info.get(k) for k in ("etag", "ETag", "md5Hash", "mtime", "created"))
            yield path.lstrip("/"), info["size"], str(next(filter(None, stamps), info["size"]))

    def read(self, name: str) -> bytes:
        """Return the content of an object."""
        data = self._request(lambda: self._fs.cat_file(self._path(name)), name)
        assert isinstance(data, bytes)
        return data

    def tail(self, entry: Entry, length: int) -> bytes:
        """Return the last bytes of an object."""
        path, start = self._path(entry.name), entry.size - length
        data = self._request(
            lambda: self._fs.cat_file(path, start=start, end=entry.size), entry.name
        )
        assert isinstance(data, bytes)
        return data

    def write_new(self, name: str, data: bytes) -> bool:
        """Write a new object; return False if the name exists. See `exclusive`."""
        if self.exclusive:
            return bool(self._request(lambda: self._create(name, data), name))
        if self.exists(name):
            return False
        self.write(name, data)
        return True

    def write(self, name: str, data: bytes) -> None:
        """Write or replace an object."""
        self._request(lambda: self._fs.pipe_file(self._path(name), data), name)

    def send(self, name: str, path: Path, stamp: str | None) -> bool:
        """Write or replace an object by a local file if its ETag is still `stamp`; see `Store`.

        By one request, of up to 5 GB: s3fs sends no If-Match with an upload in parts. Where it is
        refused although no one has written, the server lists other ETags than it compares: then
        without the condition.
        """

        def put_anyway() -> bool:
            self._request(lambda: self._fs.put_file(str(path), self._path(name)), name)
            return True

        if not (self.exclusive and hasattr(self._fs, "call_s3")):
            return put_anyway()
        bucket, _, key = self._path(name).partition("/")
        condition = {"IfNoneMatch": "*"} if stamp is None else {"IfMatch": f'"{stamp}"'}

        def put() -> None:
            with path.open("rb") as body:
                self._fs.call_s3("put_object", Bucket=bucket, Key=key, Body=body, **condition)

        try:
            self._try(put, name)
        except OSError as error:
            if isinstance(error, FileNotFoundError | FileExistsError) or code_of(error) in TAKEN:
                entry = self.stat(name)
                return (entry and entry.stamp) == stamp and put_anyway()
            raise self._refused(name, error) from error
        return True

    def exists(self, name: str) -> bool:
        """Return whether an object has this name."""
        return self._request(lambda: self._fs.info(self._path(name)), name, None) is not None

    def stat(self, name: str) -> Entry | None:
        """Return the entry of an object; None if none has this name."""
        return next((entry for entry in self.list(name) if entry.name == name), None)

    def remove(self, name: str) -> None:
        """Remove an object; no error if it does not exist."""
        self._request(lambda: self._fs.rm_file(self._path(name)), name, None)

    def fetch(self, name: str, folder: Path) -> Path:
        """Copy the object to `folder` / `name`, completely or not at all; return the path."""
        target = path_below(folder, name, self.url)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
        except (FileExistsError, NotADirectoryError) as error:
            fact = "a folder of its name is an object too"
            raise InputError(f"{self.url}/{name}: {fact}: rename one of them") from error
        temporary = target.with_name(f"{PARTIAL}-{uuid.uuid4().hex}")
        try:
            self._request(lambda: self._fs.get_file(self._path(name), str(temporary)), name)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
        return target

    @property
    def _fs(self) -> Any:
        """File system of the current process; connections do not survive a fork."""
        if self._opened is None or self._opened[0] != os.getpid():
            self._opened = os.getpid(), file_system(self.url)
        return self._opened[1]

    def _path(self, name: str) -> str:
        return f"{self.url.partition('://')[2].strip('/')}/{name}"

    def _create(self, name: str, data: bytes) -> bool:
        """Put unless the name exists; return whether this call, retried or not, created it."""
        sent = 0

        def put() -> None:
            nonlocal sent
            sent += 1
            self._fs.pipe_file(self._path(name), data, mode="create")

        try:
            self._try(put, name)
        except OSError as error:
            if not isinstance(error, FileExistsError) and code_of(error) not in TAKEN:
                raise
            return sent > 1 and self.read(name) == data  # a first put whose reply was lost
        return True

    def _request(self, request: Callable[[], T], name: str, absent: Any = ...) -> Any:
        """Return the response; `absent`, if given, for a missing object. Raises InputError."""
        try:
            return self._try(request, name)
        except FileNotFoundError as error:
            if absent is not ...:
                return absent
            raise InputError(
                f"{self.url}/{name}: no such object: check whether it was moved"
            ) from error
        except OSError as error:
            raise self._refused(name, error) from error

    def _try(
        self, request: Callable[[], T], name: str, tries: int = TRIES, most_s: float = math.inf
    ) -> T:
        """Return the response to a request, retried after transient faults with longer waits.

        Not more than `tries` times, nor after most_s seconds, unless the store is patient.
        """
        began_s = time.monotonic()
        for attempt in count():
            try:
                response = request()
                if attempt >= tries:
                    self.back_s = time.monotonic()
                return response
            except WheelplaneError:
                raise
            except Exception as error:
                if not is_transient(error):
                    if isinstance(error, OSError) and not isinstance(error, PermissionError):
                        raise
                    raise self._refused(name, error) from error
                took_s = time.monotonic() - began_s
                if attempt >= tries - 1 or took_s > most_s:
                    times = f"{attempt + 1} tries" if attempt else "1 try"
                    refused = self._refused(name, error, f" after {times}")
                    if self._note is None or took_s > AWAY_S:
                        raise refused from error
                    self._say_away(refused)
            time.sleep(FIRST_WAIT_S * 2 ** min(attempt, TRIES - 2) * random.uniform(0.5, 1.5))  # noqa: S311
        raise AssertionError

    def _say_away(self, refused: InputError) -> None:
        """Note that the server is waited for, once a minute for all requests."""
        if self._note is not None and time.monotonic() > self._noted_s + NOTED_S:
            self._noted_s = time.monotonic()
            self._note(f"{refused}: waiting for it up to {AWAY_S / 60:.0f} min")

    def _refused(self, name: str, error: Exception, when: str = "") -> InputError:
        if is_redirected(error):
            return InputError(
                f"{self.url}/{name}: the server redirects each request, to no end: give its own "
                "address (AWS_ENDPOINT_URL) and the bucket's region (AWS_DEFAULT_REGION)"
            )
        fact = " ".join(str(error).split())[:200] or type(error).__name__
        code = code_of(error)
        fact = fact if code.isdecimal() or code in fact else f"{code}: {fact}"
        return InputError(
            f"{self.url}/{name}: request to object storage failed{when} ({fact}): check its "
            "address, credentials and permissions"
        )


def _shown(name: str) -> bool:
    return not name.startswith(f"{PARTIAL}/")
