"""The terms on which a scenario is read: its document, where its paths begin, and which code it may name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from testbed.errors import UnknownNameError
from testbed.inputs.plugins import PluginError, Plugins, running
from testbed.parts import resolve

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from testbed.document import Document, Key, Model


@dataclass(frozen=True)
class Intake:
    """A document and the terms on which its parts are read.

    Parameters
    ----------
    document : Document
        Takes the findings.
    folder : Path
        Where relative paths begin.
    plugins : Plugins
        Whose classes the document may name.
    allow_outside : bool
        Whether a recorded motion may lie outside the folder.
    """

    document: Document
    folder: Path
    plugins: Plugins
    allow_outside: bool = False

    def resolve(self, kind: str, name: str, registry: Mapping[str, str], base: type[Any]) -> type[Any]:
        """Return the class that a name stands for.

        Parameters
        ----------
        kind, name : str
            What it is, and its name.
        registry : mapping of str to str
            The shipped ones.
        base : type
            What it has to be.

        Raises
        ------
        UnknownNameError
            If there is no such class.
        """
        part = resolve(kind, name, registry, self.plugins)
        if not issubclass(part, base):
            raise UnknownNameError(kind, name, registry, reason=f"expected a {base.__module__}.{base.__qualname__}")
        return part

    def validate(self, model: type[Model], data: Any, key: Key, *, shipped: bool = True) -> Model | None:
        """Return `data` as `model`; None, with the findings noted, if it is none.

        Parameters
        ----------
        model : type
            What it has to be.
        data : Any
            As it stands in the document.
        key : tuple
            Where.
        shipped : bool, optional
            Whether the model is one of ours; what a plug-in's own raises is a finding like any other.
        """
        document, options = self.document, {"allow_outside": self.allow_outside}
        if shipped:
            return document.validate(model, data, key, self.folder, **options)
        try:
            with running(f"plug-in {model.__module__}"):
                return document.validate(model, data, key, self.folder, **options)
        except PluginError as error:
            document.find(key, str(error))
            return None


def unresolved(error: UnknownNameError, name: str) -> str:
    """Return the message for an entry whose type is not known; `name` is the type that was taken."""
    return str(error) if ":" in name else f"{error}; say which with 'type:'"
