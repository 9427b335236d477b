"""The documentation, served by the program itself: it needs no network."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import FileResponse, HTMLResponse, RedirectResponse, Response

from app.web import help_pages

_IMAGES = {".svg": "image/svg+xml", ".png": "image/png", ".jpg": "image/jpeg"}
_FRESH = {"cache-control": "no-cache"}
"""The browser revalidates each time, so that an update of the program is visible at once."""


def help_router() -> APIRouter:
    """``/help/`` and everything below it."""
    router = APIRouter(prefix="/help", include_in_schema=False)

    @router.get("")
    def without_slash() -> RedirectResponse:
        return RedirectResponse("/help/")

    @router.get("/{address:path}", response_model=None)
    def page(address: str) -> Response:
        """A page as HTML, or an image. 404, as a page, for what there is not."""
        found = help_pages.files()
        image = found.get(address)
        if image is not None and image.suffix in _IMAGES:
            return FileResponse(image, media_type=_IMAGES[image.suffix], headers=_FRESH)
        file = help_pages.page_of(address)
        is_there = file in found
        shown = (
            help_pages.render(found[file].read_text(encoding="utf-8"), file)
            if is_there
            else help_pages.not_found(address)
        )
        index = found.get(help_pages.INDEX)
        nav = help_pages.navigation(index.read_text(encoding="utf-8")) if index is not None else ()
        return HTMLResponse(help_pages.html_page(shown, nav, file), 200 if is_there else 404, headers=_FRESH)

    return router
