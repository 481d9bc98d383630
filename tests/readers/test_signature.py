"""A file's format by its first bytes, and the suffix below that of a compression."""

import gzip
from contextlib import ExitStack

import pytest

from tests.readers.test_readers import WRITERS
from tests.support.paths import FORMATS
from wheelplane.errors import InputError
from wheelplane.readers.packed import scan_suffix, unpacked
from wheelplane.readers.read_scan import READERS
from wheelplane.readers.signature import BINARY, TEXT, looks_like

SAMPLES = sorted(path for path in FORMATS.iterdir() if path.suffix in READERS)


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.name)
def test_published_files_look_like_their_format(path):
    data = path.read_bytes()
    kind = looks_like(data[:4096])
    assert kind in READERS[path.suffix].signatures
    # What follows the first kilobyte decides nothing.
    assert looks_like(data[:1024] + b"\0" * 3000) == kind or kind == TEXT


def test_no_two_binary_formats_have_the_same_signature():
    kinds = {path.suffix: looks_like(path.read_bytes()[:4096]) for path in SAMPLES}
    binary = [kinds[suffix] for suffix in (".ply", ".e57", ".las", ".pcd")]
    assert len({*binary, TEXT, BINARY}) == len(binary) + 2


@pytest.mark.parametrize("head", [b"", b"1 2 3\n", "µ".encode(), b"plyx\n", b" ply\n"])
def test_text_is_what_has_no_zero_byte_and_no_signature(head):
    assert looks_like(head) == TEXT
    assert looks_like(head + b"\0") == BINARY


@pytest.mark.parametrize("suffix", sorted(READERS))
def test_the_suffix_of_the_format_is_found_below_a_compression_in_any_case(suffix):
    for name in (f"a.b{suffix}", f"folder.zip/RR{suffix.upper()}"):
        assert scan_suffix(name) == suffix
        for packed in (".gz", ".BZ2", ".xz"):
            assert scan_suffix(name + packed) == suffix


def test_unpacking_returns_the_plain_bytes_and_leaves_nothing_behind(tmp_path):
    data = WRITERS["text.ply"]([(0.0, 1.0, 2.0, 3.0)]) if "text.ply" in WRITERS else b"1 2 3\n"
    plain, packed = tmp_path / "rr.ply", tmp_path / "rr.ply.gz"
    plain.write_bytes(data)
    packed.write_bytes(gzip.compress(data))
    with ExitStack() as stack:
        assert unpacked(plain, "rr.ply", READERS, stack) == (plain, "rr.ply")
        path, name = unpacked(packed, "rr.ply.gz", READERS, stack)
        assert (path.read_bytes(), path.name, name) == (data, "rr.ply", "rr.ply.gz")
        assert path != plain
    assert not path.exists()
    packed.write_bytes(gzip.compress(data)[:-9])
    with ExitStack() as stack, pytest.raises(InputError, match=r"^rr\.ply\.gz: "):
        unpacked(packed, "rr.ply.gz", READERS, stack)
