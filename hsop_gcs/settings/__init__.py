"""FLEET.toml: read once, checked whole, turned into the plain values the layers below work with."""

from hsop_gcs.settings.reading import Fault, check_settings, read_settings
from hsop_gcs.settings.sections import SigningSection
from hsop_gcs.settings.settings import Settings

__all__ = ["Fault", "Settings", "SigningSection", "check_settings", "read_settings"]
