"""The command line: the only room that prints.

One grammar for every command, ``testbed COMMAND ARGUMENT [--option VALUE]``:

- Arguments name what is read, in capitals as placeholders (``SCENARIO.yaml``, ``RUN_DIR``); options have whole words.
- Standard output carries the result and nothing else, standard error progress and errors. ``--json`` prints the result
  as one document: names of metrics.json, units in the keys, null where undefined. ``--quiet`` leaves out progress and
  tables; the document of ``--json`` stays.
- ``--out`` is a folder where several files result, else a file; what is not given lies below ``runs/``. The document
  names it as ``written``.
- A quantity is a number in SI or carries its unit: ``--block 2``, ``--block "20 ms"``. An option that may be given
  several times is repeated. What names a column, a unit or a time of a text file is called the same everywhere.
- Exit status: 0 done, 1 an expectation was missed or a leak found, 2 bad input, 3 the run failed, 4 a fault of ours,
  130 interrupted.

docs/commands.md has the documents of ``--json``. A command is a function in `testbed.cli.commands` and a line in
`testbed.cli.app`: its docstring is the summary, one finished sentence; `expanded` gives it the shared options; heavy
libraries are imported inside.
"""

from testbed.cli.entry import main

__all__ = ["main"]
