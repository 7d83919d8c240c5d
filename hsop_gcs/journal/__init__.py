"""The journal: everything that was accepted, decided and ordered, in append-only files of JSON lines."""

from hsop_gcs.journal.backlog import GIVEN_UP
from hsop_gcs.journal.entry import Entry, Worth
from hsop_gcs.journal.journal import Journal, JournalStatus
from hsop_gcs.journal.retention import KEEP_BYTES
from hsop_gcs.journal.segments import SNAPSHOT, read

__all__ = ["GIVEN_UP", "KEEP_BYTES", "SNAPSHOT", "Entry", "Journal", "JournalStatus", "Worth", "read"]
