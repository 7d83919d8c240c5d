"""The journal: everything that was accepted, decided and ordered, in one append-only file of JSON lines."""

from hsop_gcs.journal.file import Entry, Journal, read

__all__ = ["Entry", "Journal", "read"]
