"""Records of `frozen` behave as those of `dataclasses.dataclass(frozen=True)`."""

from __future__ import annotations

import copy
import pickle
from dataclasses import FrozenInstanceError, asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import ClassVar

import pytest

from wheelplane.system import frozen


class Sized:
    unit: ClassVar[str] = "m"
    name: str
    size: float = 1.0
    parts: tuple[object, ...] = field(default=(), repr=False)
    seen: int = field(default=0, compare=False)

    @cached_property
    def doubled(self) -> float:
        return 2.0 * self.size


@frozen
class Ours(Sized):
    __annotations__ = Sized.__annotations__
    parts = field(default=(), repr=False)
    seen = field(default=0, compare=False)


@dataclass(frozen=True)
class Theirs(Sized):
    __annotations__ = Sized.__annotations__
    parts = field(default=(), repr=False)
    seen = field(default=0, compare=False)


@frozen
class Wider(Ours):
    breadth: float = 0.0


@frozen(eq=False)
class Alone:
    value: float


@frozen
class Own:
    value: float

    def __repr__(self) -> str:
        return "own"

    def __eq__(self, other: object) -> bool:
        return True

    def __hash__(self) -> int:
        return 7


BOTH = pytest.mark.parametrize("made", [Ours, Theirs])


@BOTH
def test_fields_cannot_be_set_or_deleted(made):
    one = made("a", 2.0)
    for name in ("name", "size", "unknown"):
        with pytest.raises(FrozenInstanceError):
            setattr(one, name, "b")
    with pytest.raises(FrozenInstanceError):
        del one.name
    assert (one.name, one.size, one.doubled, one.doubled) == ("a", 2.0, 4.0, 4.0)


@BOTH
def test_equality_and_hash_are_of_the_compared_fields_and_the_class(made):
    one = made("a", 2.0, seen=1)
    assert one == made("a", 2.0, seen=2)
    assert hash(one) == hash(made("a", 2.0, seen=2))
    for other in (made("b", 2.0), made("a", 2.0, (1,)), Wider("a", 2.0), ("a", 2.0, (), 1)):
        assert one != other
    assert len({made("a"), made("a"), made("b")}) == 2
    with pytest.raises(TypeError):
        hash(made([]))


@BOTH
def test_a_record_is_shown_copied_and_replaced(made):
    one = made("a", 2.0, (3,), 4)
    assert repr(one) == f"{made.__name__}(name='a', size=2.0, seen=4)"
    assert asdict(one) == {"name": "a", "size": 2.0, "parts": (3,), "seen": 4}
    for again in (pickle.loads(pickle.dumps(one)), copy.copy(one), copy.deepcopy(one)):
        assert (again, again.seen) == (one, 4)
    other = replace(one, size=5.0)
    assert (other.size, other.doubled, one.size) == (5.0, 10.0, 2.0)
    assert [one.name for one in fields(made)] == ["name", "size", "parts", "seen"]
    for wrong in ({}, {"name": "a", "unit": "mm"}):
        with pytest.raises(TypeError):
            made(**wrong)


def test_a_record_in_itself_is_shown():
    parts: list[object] = []
    one = Ours("a", parts)
    parts.append(one)
    assert repr(one) == "Ours(name='a', size=[...], seen=0)"


def test_without_equality_each_is_itself():
    one = Alone(1.0)
    assert one == one
    assert one != Alone(1.0)
    assert len({one, Alone(1.0)}) == 2


def test_what_a_class_defines_itself_is_kept():
    assert (repr(Own(1.0)), Own(1.0) == Own(2.0), hash(Own(1.0))) == ("own", True, 7)
    assert Wider("a", breadth=2.0) == Wider("a", breadth=2.0) != Wider("a")
