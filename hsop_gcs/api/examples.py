"""Answers that a running service gave, by the schema that they are examples of in the OpenAPI document."""

import json
from importlib.resources import files
from typing import Any

ANSWERS: dict[str, Any] = json.loads(files("hsop_gcs.api").joinpath("examples.json").read_text())
