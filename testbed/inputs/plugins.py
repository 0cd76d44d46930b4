"""Plug-ins: code of the user's own, which runs only because the user said so.

A scenario is data. It may name a class as ``module:Class``, but it cannot make the module load: that is said by
``--plugin``, by the environment variable ``TESTBED_PLUGINS`` or by ``plugins=`` in Python. Packages that are installed
offer their parts by entry points, which are used by their name.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import os
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.errors import Problem, RunError, ScenarioError, UnknownNameError, quoted, shortened
from testbed.inputs.files import read_bytes

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from types import ModuleType

VARIABLE = "TESTBED_PLUGINS"
GROUPS = {"filter": "testbed.filters", "sensor": "testbed.sensors", "motion": "testbed.motions"}
_MOST_SOURCE = 1 << 22


@dataclass(frozen=True)
class Plugin:
    """What of a plug-in stands in a run.

    Parameters
    ----------
    name : str
        Its module.
    version : str or None
        Of the installed package, or its ``__version__``; None if it has none.
    sha256 : str or None
        Digest of the module's source file (of a package, of its ``__init__``); None if it has no file.
    """

    name: str
    version: str | None
    sha256: str | None


class PluginError(ValueError):
    """A plug-in raised something; says where and what."""


# What this process has loaded: a module is executed once.
_LOADED: dict[str, Plugin] = {}


class Plugins:
    """Plug-ins that are loaded, and the parts that they have; made by `load_plugins`.

    Parameters
    ----------
    loaded : iterable of Plugin
        Whose modules the user named.
    """

    def __init__(self, loaded: Iterable[Plugin] = ()) -> None:
        self._used = {plugin.name: plugin for plugin in loaded}

    @property
    def used(self) -> tuple[Plugin, ...]:
        """Those that were named, and the installed ones whose parts were asked for."""
        return tuple(self._used.values())

    def classes(self) -> Iterator[tuple[str, type[Any]]]:
        """Yield ``module:Class`` and the class for each public one that a named module defines."""
        for module in self._used:
            for name, part in vars(sys.modules[module]).items():
                if isinstance(part, type) and part.__module__ == module and not name.startswith("_"):
                    yield f"{module}:{name}", part

    def part(self, kind: str, name: str, known: Iterable[str]) -> type[Any]:
        """Return the class of a plug-in that is named as ``module:Class``.

        Parameters
        ----------
        kind : str
            What it should be, for the message.
        name : str
            Module and class.
        known : iterable of str
            Names that need no plug-in, for the message.

        Raises
        ------
        UnknownNameError
            If the module was not named by the user, or has no such class.
        """
        module, _, attribute = name.partition(":")
        if module not in self._used:
            reason = (
                f"a scenario cannot load code; if you trust the module {quoted(module)}, name it by --plugin, "
                f"{VARIABLE} or plugins="
            )
            raise UnknownNameError(kind, name, known, reason=reason)
        part = getattr(sys.modules[module], attribute, None)
        if not isinstance(part, type):
            raise UnknownNameError(kind, name, known, reason=f"the module has no class {quoted(attribute)}")
        return part

    def installed(self, kind: str, name: str, known: Iterable[str]) -> type[Any] | None:
        """Return the class that an installed package offers under a name, loaded now; None if none does.

        Parameters
        ----------
        kind : str
            Which of `GROUPS`.
        name : str
            Name of the entry point.
        known : iterable of str
            Names that are shipped: another part of such a name is an error.

        Raises
        ------
        UnknownNameError
            If two packages offer the name, one offers a shipped name, or the package raises anything.
        """
        offers = _offers(GROUPS[kind]).get(name, ())
        if not offers:
            return None
        if len(offers) > 1 or name in known:
            packages = " and ".join(sorted(_package(offer) for offer in offers))
            also = ", and it is shipped" if name in known else ""
            raise UnknownNameError(kind, name, known, reason=f"the name is taken twice: offered by {packages}{also}")
        try:
            with running(f"plug-in {_package(offers[0])}"):
                part = offers[0].load()
        except PluginError as error:
            raise UnknownNameError(kind, name, known, reason=str(error)) from error
        version = offers[0].dist.version if offers[0].dist is not None else None
        self._used[offers[0].module] = Plugin(offers[0].module, version, _digest(sys.modules[offers[0].module]))
        return part if isinstance(part, type) else None


def load_plugins(named: Iterable[str] = ()) -> Plugins:
    """Load the plug-ins that the user named.

    Parameters
    ----------
    named : iterable of str
        Dotted modules or paths of ``.py`` files, besides those of the environment variable ``TESTBED_PLUGINS``.

    Raises
    ------
    ScenarioError
        If one cannot be loaded or raises anything, SystemExit included.
    """
    wanted = [*os.environ.get(VARIABLE, "").split(","), *named]
    return Plugins([_load(name.strip()) for name in wanted if name.strip()])


def offered(kind: str) -> dict[str, str]:
    """Return the names that installed packages offer for a kind, and by which package; nothing is loaded."""
    return {name: " and ".join(map(_package, offers)) for name, offers in _offers(GROUPS[kind]).items()}


@contextmanager
def running(what: str) -> Iterator[None]:
    """Turn whatever a plug-in raises inside the context, SystemExit too, into PluginError.

    Parameters
    ----------
    what : str
        Who runs, for the message.
    """
    try:
        yield
    except (KeyboardInterrupt, ScenarioError, RunError):
        raise
    except BaseException as error:
        msg = f"{what}: {type(error).__name__}: {shortened(_words(error))}"
        raise PluginError(msg) from error


def _words(error: BaseException) -> str:
    try:
        return str(error)
    except Exception:  # noqa: BLE001 - an exception of the plug-in's own
        return "no words"


def _load(name: str) -> Plugin:
    module = Path(name).stem if name.endswith(".py") else name
    if not all(part.isidentifier() for part in module.split(".")):
        raise _refusal(name, "expected a dotted module or the path of a .py file")
    if module not in _LOADED:
        try:
            with running(shortened(module)):
                _LOADED[module] = _execute(Path(name), module) if name.endswith(".py") else _import(module)
        except PluginError as error:
            raise _refusal(name, f"could not be loaded: {error}") from error
    elif name.endswith(".py") and _LOADED[module].sha256 != _sha256(_source(Path(name))):
        raise _refusal(name, "another file of this name, or an earlier state of it, is loaded: start Python again")
    return _LOADED[module]


def _import(name: str) -> Plugin:
    module = importlib.import_module(name)
    return Plugin(name, _version(module), _digest(module))


def _execute(path: Path, name: str) -> Plugin:
    """Run a file as the module of its name; what is hashed is what runs."""
    source = _source(path)
    taken = sys.modules.get(name) or importlib.util.find_spec(name)
    origin = getattr(taken, "__file__", None) or getattr(taken, "origin", None)
    if taken is not None and (origin is None or Path(origin).resolve() != path.resolve()):
        msg = f"the name {name} is taken by another module: rename the file"
        raise ImportError(msg)
    spec = importlib.util.spec_from_loader(name, None, origin=str(path))
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    module.__file__ = str(path)
    sys.modules[name] = module
    try:
        exec(compile(source, str(path), "exec"), module.__dict__)  # noqa: S102 - the user asked for it
    except BaseException:
        del sys.modules[name]
        raise
    return Plugin(name, _version(module), _sha256(source))


def _source(path: Path) -> bytes:
    return read_bytes(path, _MOST_SOURCE, "a plug-in")


def _version(module: ModuleType) -> str | None:
    try:
        return metadata.version(module.__name__.split(".")[0])
    except metadata.PackageNotFoundError:
        version = getattr(module, "__version__", None)
        return None if version is None else str(version)


def _digest(module: ModuleType) -> str | None:
    file = getattr(module, "__file__", None)
    return None if file is None else _sha256(Path(file).read_bytes())


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


@functools.cache
def _offers(group: str) -> dict[str, tuple[metadata.EntryPoint, ...]]:
    found: dict[str, tuple[metadata.EntryPoint, ...]] = {}
    for point in metadata.entry_points(group=group):
        found[point.name] = (*found.get(point.name, ()), point)
    return found


def _package(point: metadata.EntryPoint) -> str:
    return point.module if point.dist is None else f"{point.dist.name} {point.dist.version}"


def _refusal(name: str, message: str) -> ScenarioError:
    return ScenarioError([Problem(message, key=f"plug-in {shortened(name)}")])
