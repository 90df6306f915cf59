"""The place where recordings are dropped: each goes into the private folder, and a refusal is answered in words."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import suppress
from typing import Any

from nicegui import app, ui
from starlette.datastructures import UploadFile
from starlette.requests import ClientDisconnect, Request
from starlette.responses import PlainTextResponse, Response

from microrad.studio.guard.names import NameRefusedError
from microrad.studio.recordings.uploads import Upload, UploadError, Uploads

_BLOCK_BYTES = 1 << 20
_MOST_S = 600.0
# A form is spooled whole before it is stored, and counts for no limit until then; those that wait are not read.
_TURNS = asyncio.Semaphore(2)

# One request a file, one after the other; the field is emptied, so that the same file can be chosen again.
_SEND = """
async (event) => {
  const field = event.target, files = Array.from(field.files);
  field.disabled = true;
  for (const file of files) {
    if (file.size > MOST) {
      emit(file.name, "");  // the guard would end the connection before the browser has read why
      continue;
    }
    const form = new FormData();
    form.append("file", file, file.name);
    try {
      const answer = await fetch("URL", {method: "POST", body: form});
      if (!answer.ok) {
        const page = new DOMParser().parseFromString(await answer.text(), "text/html");
        emit(file.name, (page.querySelector("main > p") ?? page.body).textContent || `error ${answer.status}`);
      }
    } catch (error) {
      emit(file.name, "the connection to the studio broke off");
    }
  }
  field.value = "";
  field.disabled = false;
}
"""


class Drop:
    """A field for files; `taken` gets each stored one, `refused` the words for each that is not taken.

    It is no `ui.upload`, which cuts the path off a name before anybody could refuse it, and has buttons without names.
    """

    def __init__(
        self, uploads: Uploads, taken: Callable[[Upload], Awaitable[None]], refused: Callable[[str], None]
    ) -> None:
        """Build the field, and take its files as they are sent.

        Args:
            uploads: where files are stored.
            taken: gets each file that is stored.
            refused: gets the words for each that is not.
        """
        self._uploads, self._taken, self._refused = uploads, taken, refused
        field = ui.element("input").classes("drop-zone")
        field.props('type=file multiple aria-label="Recordings: drop files here, or choose them"')
        client = ui.context.client
        url = f"/_nicegui/client/{client.id}/upload/{field.id}"  # where the guard lets large bodies pass
        app.add_api_route(url, self._take, methods=["POST"], include_in_schema=False)
        client.on_delete(lambda: app.remove_route(url))
        most = str(uploads.limits.file_bytes)
        field.on("change", self._unsent, js_handler=_SEND.replace("URL", url).replace("MOST", most))

    def _unsent(self, event: Any) -> None:
        """Say why the page, the guard or the connection has stopped a file."""
        name, words = (str(each) for each in event.args)
        self._refused(f"{name[:60]}: {words[:400]}" if words else self._uploads.too_large(name))

    async def _take(self, request: Request) -> Response:
        """Store the file of a request, in its turn, and hand it on."""
        for stored in await self._stored(request):
            with suppress(asyncio.CancelledError):  # the page was closed meanwhile; the next one finds the file
                await self._taken(stored)
        return PlainTextResponse("read")

    async def _stored(self, request: Request) -> list[Upload]:
        """The file of a request as it is stored; nothing where it is refused, or its sender is gone."""
        try:
            async with _TURNS:
                form = await asyncio.wait_for(request.form(max_files=1, max_fields=1), _MOST_S)
                sent = [each for each in form.values() if isinstance(each, UploadFile)]
                try:
                    return [await self._uploads.save(f.filename or "", _blocks(f)) for f in sent]
                finally:
                    await form.close()
        except ClientDisconnect:
            pass
        except TimeoutError:
            self._refused(
                f"the file is not taken: it was not here after {_MOST_S / 60:g} min; cut out the part that you need, "
                "or run microrad identify on the file, which needs no upload"
            )
        except (NameRefusedError, UploadError) as error:
            self._refused(str(error))
        except OSError as error:  # of the temporary file that a form is kept in
            self._refused(f"the file could not be stored: {error.strerror or error}; check free space and permissions")
        return []


async def _blocks(sent: UploadFile) -> AsyncIterator[bytes]:
    while block := await sent.read(_BLOCK_BYTES):
        yield block
