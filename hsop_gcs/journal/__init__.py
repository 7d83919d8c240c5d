"""The journal: everything that was accepted, decided and ordered, in one append-only file of JSON lines."""

from hsop_gcs.journal.backlog import GIVEN_UP
from hsop_gcs.journal.entry import Entry, Worth
from hsop_gcs.journal.file import read
from hsop_gcs.journal.journal import Journal, JournalStatus

__all__ = ["GIVEN_UP", "Entry", "Journal", "JournalStatus", "Worth", "read"]
