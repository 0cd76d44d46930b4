"""`make linkcheck` finds what is broken: its settings, against a server of this machine."""

from __future__ import annotations

import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


class Handler(BaseHTTPRequestHandler):
    """Has one page, with one anchor."""

    def do_GET(self):
        found = self.path == "/there"
        self.send_response(200 if found else 404)
        self.end_headers()
        self.wfile.write(b"<p id='part'>there</p>" if found else b"")

    do_HEAD = do_GET  # noqa: N815 - as the library names it

    def log_message(self, *_words):
        """Say nothing."""


@pytest.fixture
def address():
    server = HTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


@pytest.mark.slow
def test_a_broken_link_and_a_missing_anchor_end_it_with_an_error_and_are_named(address, tmp_path):
    pytest.importorskip("myst_parser", reason="the extra docs is not installed")
    settings = [
        line for line in (ROOT / "docs/conf.py").read_text("utf-8").splitlines() if line.startswith("linkcheck")
    ]
    assert settings
    (tmp_path / "conf.py").write_text("\n".join(["extensions = ['myst_parser']", *settings]), encoding="utf-8")
    page, out = tmp_path / "index.md", tmp_path / "out"
    command = [sys.executable, "-m", "sphinx", "-q", "--keep-going", "-b", "linkcheck", str(tmp_path), str(out)]

    def broken(text):
        page.write_text(text, encoding="utf-8")
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        return done.returncode, (out / "output.txt").read_text("utf-8")

    assert broken(f"# A page\n\n[good]({address}/there), [part]({address}/there#part)\n") == (0, "")
    code, named = broken(f"# A page\n\n[bad]({address}/gone)\n\n[no part]({address}/there#other)\n")
    assert code == 1
    words = {word.rstrip(":") for word in named.split()}
    assert {f"{address}/gone", f"{address}/there#other"} <= words
    assert f"{address}/there" not in words


def test_make_runs_it_on_the_pages_without_drawing_the_gallery():
    rule = (ROOT / "Makefile").read_text("utf-8").split("\nlinkcheck:")[1].split("\n\n")[0]
    assert "-b linkcheck" in rule
    assert "-D plot_gallery=0 docs " in rule
