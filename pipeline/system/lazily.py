"""Names of a package whose modules are loaded when they are first asked for (PEP 562)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module


def loader(package: str, modules: Mapping[str, set[str]]) -> Callable[[str], object]:
    """Return the package's __getattr__ for names of modules of its own, such as ".profile"."""

    def load(name: str) -> object:
        for module, names in modules.items():
            if name in names:
                return getattr(import_module(module, package), name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return load
