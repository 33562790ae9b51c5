"""HTTP responses: the files of the page, and their headers."""

from __future__ import annotations

from http import HTTPStatus
from pathlib import Path

from websockets.datastructures import Headers
from websockets.http11 import Response

from taichi_soft.live.three_js import fetch_three_js

PAGE = Path(__file__).parent / "page"

FRAMED_BY = "'self' http://localhost:* http://127.0.0.1:* vscode-webview: vscode-file:"
"""Origins of the pages that can embed a world in an HTML frame: notebooks on this machine. Browsers check all
enclosing pages. VS Code shows a vscode-webview: page inside a vscode-file: page, so both are in the list."""

_KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}


def page_files() -> dict[str, tuple[str, bytes]]:
    """Return content type and content of every file that a page can request, by path."""
    fetch_three_js()
    found = {}
    for path in [*PAGE.iterdir(), *(PAGE / "three").iterdir()]:
        if path.suffix in _KINDS:
            found[f"/{path.relative_to(PAGE).as_posix()}"] = _KINDS[path.suffix], path.read_bytes()
    found["/"] = found["/index.html"]
    return found


def response(status: HTTPStatus, kind: str, content: bytes, name: str | None = None) -> Response:
    """Make a response with content of the MIME type `kind`.

    With `name`, the browser saves the content as a file of this name.
    """
    headers = Headers()
    headers["Content-Type"] = f"{kind}; charset=utf-8" if kind.startswith("text/") else kind
    headers["Content-Length"] = str(len(content))
    headers["Cache-Control"] = "no-store"
    headers["X-Content-Type-Options"] = "nosniff"
    headers["Content-Security-Policy"] = (
        "default-src 'self'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; "
        f"img-src 'self' data: blob:; connect-src 'self' ws: wss:; frame-ancestors {FRAMED_BY}"
    )
    if name is not None:
        headers["Content-Disposition"] = f'attachment; filename="{name}"'
    return Response(int(status), status.phrase, headers, content)
