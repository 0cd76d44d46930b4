"""What a page shows to be typed, done as it stands: block after block, in one folder, with one set of names."""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

import testbed
from testbed.campaigns.study import load_study
from testbed.logs.logmap import load_map
from tests.project.given import LONG, ON_A_CLUSTER, whole
from tests.shell import call

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("docs/*.md"), *ROOT.glob("docs/tutorials/*.md"), *ROOT.glob("docs/reference/*.md")])
PAGES = [*PAGES, *(ROOT / f"{name}.md" for name in ("README", "CONTRIBUTING", "SECURITY"))]
# Blocks whose word is in braces are directives of the site's, such as a table of contents.
FENCE = re.compile(r"^```(\{.*|\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NAMED = re.compile(r"# ([\w.]+\.yaml)\n")


def blocks(page: Path) -> list[tuple[str, str]]:
    """Return language and text of each block of a page, in its order."""
    return [block for block in FENCE.findall(page.read_text(encoding="utf-8")) if not block[0].startswith("{")]


@dataclass
class Reader:
    """Who types a page: the folder in which it happens, the names of the Python blocks, and what was said."""

    folder: Path
    names: dict[str, Any] = field(default_factory=dict)
    said: str = ""

    def follow(self, kind: str, text: str) -> None:
        """Do what a block shows; an unknown kind of block is an error, since nobody would try it."""
        getattr(self, f"_{kind or 'unnamed'}")(text)

    def _unnamed(self, text: str) -> None:
        msg = f"a block of a page needs its language, or nothing tries it:\n{text}"
        raise AssertionError(msg)

    def _sh(self, text: str) -> None:
        for line in text.replace("\\\n", " ").splitlines():
            self._type(line)

    def _console(self, text: str) -> None:
        """Type a command and compare the words that it answers, of both streams; ``...`` stands for what differs."""
        for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
            line, _, wanted = part.partition("\n")
            done = call(*shlex.split(line)[1:], cwd=self.folder)
            answer = done.stdout + done.stderr
            assert doctest.OutputChecker().check_output(wanted, answer, doctest.ELLIPSIS), f"{line}\n{answer}"

    def _python(self, text: str) -> None:
        program = compile(text, "a block of a page", "exec")
        if any(f"from {name}" in text for name in ON_A_CLUSTER):
            return
        with contextlib.redirect_stdout(io.StringIO()) as said:
            exec(program, self.names)  # noqa: S102 - a page of this repository
        self.said += said.getvalue()

    def _pycon(self, text: str) -> None:
        test = doctest.DocTestParser().get_doctest(text, self.names, "page", None, None)
        runner = doctest.DocTestRunner(verbose=False, optionflags=doctest.ELLIPSIS)
        said: list[str] = []
        runner.run(test, out=said.append, clear_globs=False)
        # The runner works on the names themselves, so that the next block has them.
        self.names.update(test.globs)
        assert not runner.failures, "".join(said)

    def _yaml(self, text: str) -> None:
        """Write a file under the name that it gives itself, and let the reader of such files take it."""
        name = NAMED.match(text)
        path = self.folder / (name[1] if name else "shown.yaml")
        path.write_text(text, encoding="utf-8")
        keys = YAML(typ="safe").load(text)
        if "base" in keys:
            load_study(path)
        elif "channels" in keys:
            load_map(path)
        else:
            testbed.Scenario.from_dict(keys if "name" in keys else whole(keys))

    def _text(self, text: str) -> None:
        """Leave what is only to be read."""

    def _octave(self, text: str) -> None:
        """Leave Octave to tests/project/test_tutorials.py, which runs it where it is installed."""
        assert "pkg load netcdf" in text

    def _type(self, line: str) -> None:
        words = shlex.split(line, comments=True)
        if not words or line.split("  #", maxsplit=1)[0].strip() in LONG:
            return
        if words[0] == "make":
            # What installs is tried by whoever clones the repository; here, that there is such a target.
            assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE), line
            return
        assert words[0] == "testbed", line
        words, rest = (words[: words.index("|")], words[words.index("|") + 1 :]) if "|" in words else (words, [])
        done = call(*words[1:], cwd=self.folder)
        assert done.returncode == line.endswith("status 1"), f"{line}\n{done.stdout}{done.stderr}"
        self.said += done.stdout
        if rest:
            assert rest[0] == "python", line
            piped = [sys.executable, *rest[1:]]
            self.said += subprocess.run(piped, input=done.stdout, capture_output=True, text=True, check=True).stdout
