"""Play hostile inputs: ``python -m tests.fuzz --cases 100000 --workers 2``."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from tests.fuzz.campaign import run
from tests.fuzz.cases import KINDS


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--kind", action="append", choices=KINDS)
    parser.add_argument("--out", type=Path, default=Path("runs/fuzz"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    begin = time.monotonic()
    table = run(options.kind or list(KINDS), options.cases, options.workers, options.first, options.out)
    table.show(time.monotonic() - begin)
    sys.exit(bool(table.faults))


if __name__ == "__main__":
    main()
