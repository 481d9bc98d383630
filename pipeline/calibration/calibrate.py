"""Calibration of a machine: readings against references, the whole story."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from .. import __version__
from ..errors import InputError, Wording
from ..measurement import Measurement
from .conventions import convention_warnings
from .evaluate import adjustments, complete_points, evaluate_quantity
from .forms.fault import Fault
from .forms.item import ItemFile
from .forms.quantities import QUANTITIES
from .forms.readings import STATES, Reading, Readings, WhyNot, read_readings, sound_readings
from .forms.table_file import Faults
from .records import Calibration, QuantityResult, ReferenceRecord
from .reference import Reference, reference_of

READ_AT_ALL = ("toe", "camber")  # at wheels and trials


def calibrate(
    references: Sequence[Reference], item_file: ItemFile, readings: Readings
) -> Calibration:
    """Evaluate readings against references. Raises FaultyTableError with all that is missing."""
    faults = Faults(readings.source)
    results = [
        evaluate_quantity(group, references, item_file.item, item_file.decision, faults)
        for group in _groups(readings)
    ]
    faults.check()
    return _calibration(references, item_file, readings, results)


def calibrate_unfinished(
    references: Sequence[Reference], item_file: ItemFile, path: Path
) -> tuple[Calibration, tuple[Fault, ...]]:
    """Evaluate the points at `path` that are read completely; return also every fault of the file.

    Of a quantity, the points are evaluated that were read in each series and direction that it has.
    Raises InputError for a file that is no table.
    """
    faults = Faults(path.name)
    item, rule = item_file.item, item_file.decision
    readings = sound_readings(path, item, why_not_of(references, item_file), faults)
    results = []
    for group in _groups(readings):
        result = evaluate_quantity(group, references, item, rule, faults)
        whole = complete_points(group)
        if result is None and 0 < len(whole) < len(group):
            result = evaluate_quantity(whole, references, item, rule, Faults(path.name))
        results.append(result)
    return _calibration(references, item_file, readings, results), tuple(faults.found)


def _groups(readings: Readings) -> list[list[Reading]]:
    """Return readings by quantity and state, in the order of `QUANTITIES`."""
    found = [
        [one for one in readings.rows if (one.quantity, one.state) == (kind, state)]
        for kind in QUANTITIES
        for state in STATES
    ]
    return [group for group in found if group]


def _calibration(
    references: Sequence[Reference],
    item_file: ItemFile,
    readings: Readings,
    found: Sequence[QuantityResult | None],
) -> Calibration:
    results = tuple(
        replace(result, unread=_unread(result, readings, references))
        for result in found
        if result is not None
    )
    return Calibration(
        item=item_file.item,
        rule=item_file.decision,
        references=tuple(ReferenceRecord(r.series, r.measurement.provenance) for r in references),
        readings=readings,
        results=results,
        adjustments=adjustments(results),
        warnings=convention_warnings(results, references, item_file.item, readings.rows),
        notes=tuple(dict.fromkeys(note for r in references for note in r.measurement.notes)),
        version=__version__,
    )


def _unread(
    result: QuantityResult, readings: Readings, references: Sequence[Reference]
) -> tuple[str, ...]:
    """Return the points at which a quantity was not read in the state of its result.

    Of toe and camber among all wheels and trials of the references; of any quantity as left among
    the points that were read as found.
    """
    of_it = [one for one in readings.rows if one.quantity == result.quantity]
    read = {one.point for one in of_it if one.state == result.state}
    at_all = references if result.quantity in READ_AT_ALL else ()
    known = [name for one in at_all for name in one.wheels]
    if result.state == "as left":
        known += [one.point for one in of_it]
    return tuple(name for name in dict.fromkeys(known) if name not in read)


def calibrate_file(references: Sequence[Reference], item_file: ItemFile, path: Path) -> Calibration:
    """Read the readings at `path` and evaluate them.

    Raises FaultyTableError, and InputError for no table and for a reference that none was read of.
    """
    readings = read_readings(path, item_file.item, why_not_of(references, item_file))
    read = {one.series for one in readings.rows}
    for reference in references:
        if reference.series is not None and reference.series not in read:
            raise InputError(
                f"{path.name}: no reading is of series {reference.series}, whose reference is "
                f"{reference.source}: add its readings, or leave that reference out"
            )
    return calibrate(references, item_file, readings)


def why_not_of(references: Sequence[Reference], item_file: ItemFile) -> WhyNot:
    """Return the check of readings that says why a point has no reference value in a series."""

    def why_not(kind: str, point: str, series: str) -> str:
        reference = reference_of(references, series)
        if reference is None:
            known = ", ".join(str(one.series) for one in references)
            return Wording(
                "series {series} has no reference: those given are of series {known}",
                series=repr(series),
                known=known,
            )
        found = reference.value(kind, point, item_file.item)
        return found if isinstance(found, str) else ""

    return why_not


def by_series(references: Sequence[Reference]) -> tuple[Reference, ...]:
    """Return references in their order as those of series 1, 2, ...; a single one is of all.

    One measurement where several are of the same files: as captures and as their results.
    """
    if not references:
        raise InputError("no reference is given: name a capture, or five-point files")
    if len(references) == 1:
        return (Reference(references[0].measurement),)
    first: dict[frozenset[str], Measurement] = {}
    measured = [
        first.setdefault(known, one.measurement) if known else one.measurement
        for one in references
        for known in [one.measurement.provenance.checksums]
    ]
    return tuple(Reference(one, str(k)) for k, one in enumerate(measured, 1))
