"""Missions in the journal: those that were accepted, and the one that is arriving in chunks."""

from __future__ import annotations

import time
from collections.abc import Iterator

import msgspec

from stopgo.bridge.link.protocol import Manifest
from stopgo.bridge.robot.journal_format import put_chunks
from stopgo.bridge.robot.journal_rows import JournalRows
from stopgo.mission.document.decoding import decoded

MISSIONS_KEPT = 4
"""Missions stored beyond those that are needed; of older ones only the names stay."""
CHUNKS_AT_ONCE = 8
"""Chunks that are read or deleted in one transaction."""
YIELD_S = 0.0005
"""Pause between two transactions: a lock that is taken again at once never goes to another thread."""
UNUSED = "document NOT IN (SELECT document FROM missions UNION SELECT document FROM transfers)"


class StoredMissions:
    """The missions in a journal's rows; every method may be called from any thread."""

    def __init__(self, rows: JournalRows) -> None:
        self._rows = rows

    def read(self, mission_id: str, revision: int) -> tuple[Manifest, bytes] | None:
        """Return a stored mission; `None` if there is none, or only its name is still stored."""
        manifest = self.manifest(mission_id, revision)
        return None if manifest is None else (manifest, b"".join(self.chunks(manifest)))

    def manifest(self, mission_id: str, revision: int) -> Manifest | None:
        """Return the same without its document."""
        rows = self._rows.read(
            "missions", "WHERE mission_id = ? AND revision = ? AND document != 0", mission_id, revision
        )
        return decoded(rows[0][2], Manifest) if rows else None

    def part(self, manifest: Manifest, start: int, size: int) -> bytes:
        """Return `size` bytes of a stored mission's document, from byte `start` on."""
        first, last = start // manifest.chunk_bytes, (start + size - 1) // manifest.chunk_bytes
        data = b"".join(self.chunks(manifest, first, last))
        return data[start - first * manifest.chunk_bytes :][:size]

    def chunks(self, manifest: Manifest, first: int = 0, last: int = 10**9) -> Iterator[bytes]:
        """Yield the chunks of a document, stored or arrived so far; commands are carried out between them."""
        document = self._document(manifest)
        for number in range(first, min(last + 1, manifest.chunks), CHUNKS_AT_ONCE):
            if number > first:
                time.sleep(YIELD_S)
            clause = "WHERE document = ? AND number BETWEEN ? AND ? ORDER BY number"
            until = min(number + CHUNKS_AT_ONCE - 1, last)
            yield from (row[2] for row in self._rows.read("chunks", clause, document, number, until))

    def _document(self, manifest: Manifest) -> int:
        """Return the number of the mission's document, stored or arriving; 0 if there is neither."""
        key = (manifest.mission_id, manifest.revision)
        rows = self._rows.select("SELECT document FROM missions WHERE mission_id = ? AND revision = ?", *key)
        return next((number for (number,) in rows if number), self._arriving(manifest))

    def _arriving(self, manifest: Manifest) -> int:
        """Return the number of this document if it is the one that is arriving, else 0."""
        rows = self._rows.read("transfers", "WHERE mission_id = ?", manifest.mission_id)
        same = rows and _document_key(decoded(rows[0][1], Manifest)) == _document_key(manifest)
        return int(rows[0][2]) if same else 0

    def store(self, manifest: Manifest, document: bytes) -> None:
        """Store a mission that did not come in chunks."""
        with self._rows.transaction():
            number = self._new_document()
            put_chunks(self._rows.connection, number, document, manifest.chunk_bytes)
            self._name_mission(manifest, number)

    def _name_mission(self, manifest: Manifest, document: int) -> None:
        encoded = msgspec.json.encode(manifest)
        self._rows.write("missions", manifest.mission_id, manifest.revision, encoded, document)

    def _new_document(self) -> int:
        newest = "SELECT MAX(document) AS number FROM "
        tables = " UNION ALL ".join(newest + table for table in ("missions", "transfers", "chunks"))
        return 1 + int(self._rows.select(f"SELECT COALESCE(MAX(number), 0) FROM ({tables})")[0][0])

    def newest_manifest(self, mission_id: str) -> Manifest | None:
        """Return the manifest of the newest revision, even if only its name is still stored."""
        statement = "SELECT manifest FROM missions WHERE mission_id = ? ORDER BY revision DESC LIMIT 1"
        rows = self._rows.select(statement, mission_id)
        return decoded(rows[0][0], Manifest) if rows else None

    def complete_transfer(self, manifest: Manifest) -> None:
        """End the transfer, and make what has arrived a stored mission, unless it is one already.

        Its chunks stay where they are. So this is quick, however long the document is.
        """
        with self._rows.transaction():
            if self.manifest(manifest.mission_id, manifest.revision) is None:
                self._name_mission(manifest, self._document(manifest))
            self.end_transfer(manifest)

    def retire(self, *needed: tuple[str | None, int | None]) -> None:
        """Keep the missions that are `needed` (id, revision) and the newest few; of the others only the name.

        The name still shows that a revision was stored here, and with which digest.
        """
        with self._rows.transaction():
            whole = self._rows.select(
                "SELECT mission_id, revision, manifest FROM missions WHERE document != 0 ORDER BY rowid"
            )
            old = [row for row in whole if row[:2] not in needed]
            for mission_id, revision, manifest in old[:-MISSIONS_KEPT]:
                self._rows.write("missions", mission_id, revision, manifest, 0)

    def drop_unused_chunks(self) -> None:
        """Delete the chunks of documents that nothing refers to; commands are carried out between them."""
        while self._rows.select(f"SELECT 1 FROM chunks WHERE {UNUSED} LIMIT 1"):
            self._rows.delete(
                "chunks", f"rowid IN (SELECT rowid FROM chunks WHERE {UNUSED} LIMIT {CHUNKS_AT_ONCE})"
            )
            time.sleep(YIELD_S)

    def transfer(self, mission_id: str) -> Manifest | None:
        """Return the manifest of the transfer of this mission; `None` if none is open."""
        rows = self._rows.read("transfers", "WHERE mission_id = ?", mission_id)
        return decoded(rows[0][1], Manifest) if rows else None

    def begin_transfer(self, manifest: Manifest) -> None:
        """Begin to receive a mission, and end any other transfer; chunks of the same document stay."""
        with self._rows.transaction():
            number = self._arriving(manifest) or self._new_document()
            self._rows.delete("transfers", "TRUE")
            self._rows.write("transfers", manifest.mission_id, msgspec.json.encode(manifest), number)

    def end_transfer(self, manifest: Manifest) -> None:
        self._rows.delete("transfers", "mission_id = ?", manifest.mission_id)

    def store_chunk(self, manifest: Manifest, number: int, data: bytes) -> None:
        """Store a chunk of the open transfer."""
        with self._rows.transaction():
            self._rows.write("chunks", self._arriving(manifest), number, data)

    def received_chunks(self, manifest: Manifest) -> tuple[int, ...]:
        """Return the numbers of the chunks that have arrived."""
        document = self._arriving(manifest)
        rows = self._rows.select("SELECT number FROM chunks WHERE document = ? ORDER BY number", document)
        return tuple(number for (number,) in rows)


def _document_key(manifest: Manifest) -> tuple[str, int]:
    """Return the document's hash and the size of its chunks: they make chunks interchangeable."""
    return manifest.sha256, manifest.chunk_bytes
