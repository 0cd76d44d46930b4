"""A campaign as the command line plays it: what it takes is told, then how far it is, and what an interrupt leaves."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from testbed.cli.interruption import keeping_runs
from testbed.cli.progress import sweeping

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from testbed.campaigns.study import Study
    from testbed.cli.options import Output


def tell_size(study: Study, workers: int, output: Output, folder: Path) -> None:
    """Say how many cases and runs there are, and what they take.

    Parameters
    ----------
    study : Study
        What will be played.
    workers : int
        Processes.
    output : Output
        Where the words go; nothing is tried out where nobody reads them.
    folder : Path
        Where it will go.

    Raises
    ------
    ScenarioError
        If the folder holds something else: not after what it takes has been tried out.
    """
    from testbed.campaigns.store import refuse_others

    refuse_others(folder, study.document())
    if output.quiet:
        return
    from testbed.campaigns.size import size_of, sweep_words

    try:
        words = sweep_words(size_of(study, workers))
    except Exception as error:  # noqa: BLE001 - a case that fails is a row with its reason, and stops no other
        words = f"{len(study.cases)} cases; what they take is not known, since the first one fails: {error}"
    output.note(f"{study.name}: {words}")


@contextmanager
def playing(name: str, output: Output) -> Iterator[dict[str, Any]]:
    """Yield the options that let a campaign show how far it is; an interrupt inside says that its rows are kept.

    Parameters
    ----------
    name : str
        Of the campaign.
    output : Output
        Where the words go.
    """
    with keeping_runs():
        if output.quiet:
            yield {}
        else:
            with sweeping(name) as told:
                yield {"progress": told}
