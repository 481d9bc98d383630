"""Damage to a file, as copies, programs and malice do it; all of it decided by a seed."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tests.fuzzing.samples import Sample
from tests.fuzzing.swollen import ENTRY_BYTES, many_entries, tar_header

Rng = np.random.Generator
HEAD_BYTES = 600  # most headers end within these
TAIL_BYTES = 8192  # the XML of an E57 file, the directory of an archive
LARGE_BYTES = 300_000

NEAR = (-1, 1, 2, 10)
HUGE = tuple(
    sign * 2**power + off for sign, power, off in
    ((1, 15, 0), (1, 16, -1), (1, 31, -1), (1, 31, 0), (-1, 31, 0), (1, 32, -1), (1, 32, 0),
     (1, 40, 0), (1, 53, 1), (1, 63, -1), (-1, 63, 0), (1, 64, -1), (-1, 0, 0), (0, 0, 0))
)  # fmt: skip
ODD_NUMBERS = (b"nan", b"-nan", b"inf", b"-Infinity", b"1e999", b"-1e308", b"1e-400", b"0x10")
ODD_NUMBERS += (b"1_0", b"1,5", b"--1", b"1.2.3", b"", b"1e11", b"\xd9\xa1", b"1" * 400, b"nan(1)")
JUNK = (b"\0", b"\r", b"\n", b"\n\n", b"\x1a", b"#", b"//", b'"', b",", b";", b"\t", b" ", b"-")
JUNK += (b"\xef\xbb\xbf", b"\xff\xfe", b"\x80", b"\xc3", b"\x0c", b"\xe2\x80\xa8", b"\x85", b"&a;")
JUNK += (b"\0" * 512, b"9" * 5000, b"9" * 100_000, b"(" * 300, b"<a>" * 300, b"\n" * 300)
SWOLLEN = (b"1", b"x", b"1 ", b"1,", b"[", b"{a=", b"a.", b'"a".', b" ", b"#", b"\n", b"\r")
SWOLLEN += (b"nan nan nan\n", b"1 2 3\n", b"[[runout]]\n", b"[a.b.c]\n")
SWOLLEN += (b'[[trial]]\nname="a"\nfile="b"\n',)
NUMBER = re.compile(rb"[-+]?\d+(\.\d*)?(e[-+]?\d+)?", re.IGNORECASE)
WHOLE = re.compile(rb"(?<![\d.])\d+(?![\d.])")


@dataclass(frozen=True)
class Mutant:
    """A damaged file and how it came about."""

    sample: Sample
    data: bytes
    how: str


def mutant(pool: Sequence[Sample], index: int, seed: int) -> Mutant:
    """Number `index` of the samples in turn; the same for the same pool, index and seed."""
    sample = pool[index % len(pool)]
    rng = np.random.default_rng([seed, zlib.crc32(sample.name.encode()), index // len(pool)])
    data, how = sample.data, []
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        name = str(rng.choice(list(MUTATIONS)))
        data = MUTATIONS[name](rng, data, sample, pool)
        how.append(name)
    return Mutant(sample, sample.seal(data), " + ".join(how))


def _cut_at_section(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    return data[: max(0, _boundary(rng, sample) + int(rng.integers(-1, 2)))]


def _cut(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    return data[: _place(rng, data)]


def _flip_bits(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    damaged = bytearray(data)
    for _ in range(int(rng.choice([1, 1, 2, 8])) if data else 0):
        damaged[_place(rng, data)] ^= 1 << int(rng.integers(8))
    return bytes(damaged)


def _random_bytes(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    start = _place(rng, data)
    noise = rng.bytes(int(rng.choice([1, 4, 64])))
    return data[:start] + noise + data[start + len(noise) :]


def _wrong_count(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    """Another whole number in place of one that is written in text, mostly in the header."""
    found = _found(rng, WHOLE, data)
    if not found:
        return _wrong_field(rng, data, sample, pool)
    start, end = found[int(len(found) * rng.random() ** 2)]
    old = int(data[start:end][:18])
    new = old + int(rng.choice(NEAR)) if rng.random() < 0.5 else HUGE[rng.integers(len(HUGE))]
    return data[:start] + str(new).encode() + data[end:]


def _wrong_field(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    """Another whole number in place of one that is stored in binary, mostly in the header."""
    size = int(rng.choice([1, 2, 4, 8]))
    start = _place(rng, data)
    start -= start % min(size, 4) if rng.random() < 0.8 else 0
    order = "little" if rng.random() < 0.8 else "big"
    old = int.from_bytes(data[start : start + size], order)
    new = old + int(rng.choice(NEAR)) if rng.random() < 0.5 else HUGE[rng.integers(len(HUGE))]
    field = (new % 256**size).to_bytes(size, order)
    return data[:start] + field + data[start + size :]


def _odd_number(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    """NaN, infinity, or what is hardly a number, in place of one."""
    found = _found(rng, NUMBER, data)
    if found and rng.random() < 0.6:
        start, end = found[rng.integers(len(found))]
        return data[:start] + ODD_NUMBERS[rng.integers(len(ODD_NUMBERS))] + data[end:]
    value = rng.choice([np.nan, np.inf, -np.inf, 1e38, 1e-40, -0.0, -1e11])
    field = struct.pack(str(rng.choice(["<d", "<f", ">d"])), value)
    start = _place(rng, data)
    start -= start % 4 if rng.random() < 0.8 else 0
    return data[:start] + field + data[start + len(field) :]


def _nothing(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    """An empty file, or one byte over and over."""
    return [b"", b"\0" * len(data), b"\n", b" \n" * 20, b"\xff" * len(data)][rng.integers(5)]


def _repeat_block(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    """Once or a few times more, or as often as a large file would hold it."""
    start, end = _block(rng, data, sample)
    most = LARGE_BYTES // (end - start)
    times = min(int(rng.choice([1, 1, 1, 3, 40, most])), max(most, 1))
    return data[:end] + data[start:end] * times + data[end:]


def _drop_block(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    start, end = _block(rng, data, sample)
    return data[:start] + data[end:]


def _swap_blocks(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    start, middle = _block(rng, data, sample)
    end = min(len(data), 2 * middle - start)
    return data[:start] + data[middle:end] + data[start:middle] + data[end:]


def _splice(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    """The head of this file, the tail of another; mostly of one of the same format."""
    alike = [other for other in pool if other.format == sample.format]
    other = (alike if rng.random() < 0.7 else pool)[rng.integers(10**6) % len(alike)]
    return data[: _boundary(rng, sample)] + other.data[_boundary(rng, other) :]


def _another_file(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    """Another format under this name."""
    return pool[rng.integers(len(pool))].data


def _insert(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    start = _boundary(rng, sample) if rng.random() < 0.5 else _place(rng, data)
    return data[:start] + JUNK[rng.integers(len(JUNK))] + data[start:]


def _append(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    tail = [b"\n", b"\0", b"\0" * 4096, b"1 2 3\n", b"1 2 3", rng.bytes(20), data]
    return data + tail[rng.integers(len(tail))]


def _other_marks(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    """Other ends of lines, decimal marks or delimiters, all over the file."""
    old, new = [
        (b"\n", b"\r\n"), (b"\n", b"\r"), (b".", b","), (b" ", b"\t"), (b" ", b"  "),
        (b" ", b","), (b"\n", b"\n\n"), (b"\n", b" \n"), (b"\n", b""), (b"-", b"\xe2\x88\x92"),
    ][rng.integers(10)]  # fmt: skip
    return data.replace(old, new)


def _swell(rng: Rng, data: bytes, sample: Sample, pool: Sequence[Sample]) -> bytes:
    """A name, a list of files, a key or a line without end, of up to 16 MB."""
    size = int(2 ** rng.uniform(7.0, 24.0))
    if ".tar" in sample.file:
        return tar_header(size, pax=rng.random() < 0.5, packed=sample.file.endswith("gz")) + data
    if data.startswith(b"PK"):
        return many_entries(data, size // ENTRY_BYTES) if rng.random() < 0.8 else data
    word = SWOLLEN[rng.integers(len(SWOLLEN))]
    start = _boundary(rng, sample) if rng.random() < 0.8 else _place(rng, data)
    return data[:start] + word * (size // len(word)) + data[start:]


MUTATIONS: dict[str, Callable[[Rng, bytes, Sample, Sequence[Sample]], bytes]] = {
    "cut at a section": _cut_at_section,
    "cut": _cut,
    "flip bits": _flip_bits,
    "random bytes": _random_bytes,
    "wrong count": _wrong_count,
    "wrong field": _wrong_field,
    "odd number": _odd_number,
    "nothing": _nothing,
    "repeat a block": _repeat_block,
    "drop a block": _drop_block,
    "swap blocks": _swap_blocks,
    "splice": _splice,
    "another file": _another_file,
    "insert": _insert,
    "append": _append,
    "other marks": _other_marks,
    "swell": _swell,
}


def _boundary(rng: Rng, sample: Sample) -> int:
    return int(sample.sections[rng.integers(len(sample.sections))])


def _found(rng: Rng, pattern: re.Pattern[bytes], data: bytes) -> list[tuple[int, int]]:
    """Where the pattern stands in the head of the file or, now and then, in its tail."""
    first = max(0, len(data) - TAIL_BYTES) if rng.random() < 0.3 else 0
    return [match.span() for match in pattern.finditer(data, first, first + TAIL_BYTES)]


def _place(rng: Rng, data: bytes) -> int:
    """A byte of the file, half of the time of its head."""
    end = min(len(data), HEAD_BYTES) if rng.random() < 0.5 else len(data)
    return int(rng.integers(max(end, 1)))


def _block(rng: Rng, data: bytes, sample: Sample) -> tuple[int, int]:
    """Start and end: from one section to another, or anywhere."""
    ends = (
        [_boundary(rng, sample), _boundary(rng, sample)]
        if rng.random() < 0.6
        else [_place(rng, data), _place(rng, data)]
    )
    start, end = sorted(min(end, len(data)) for end in ends)
    return start, max(end, start + 1)
