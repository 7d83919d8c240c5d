"""The REST API: the edge towards operator consoles."""

from hsop_gcs.api.routes import create_api

__all__ = ["create_api"]
