"""The journal: everything that was accepted, decided and ordered, in one append-only file of JSON lines."""

from hsop_gcs.journal.file import Entry, Journal, Repair, read

__all__ = ["Entry", "Journal", "Repair", "read"]
