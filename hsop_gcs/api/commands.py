"""What commands share: how they name hosts, and that none of them has more fields than any could have."""

from collections.abc import Callable, Coroutine, Sequence
from typing import Annotated, Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from pydantic import BeforeValidator, Field, WithJsonSchema

from hsop_gcs.api.bodies import MAX_FIELDS
from hsop_gcs.api.problems import TooManyFields
from hsop_gcs.errors import BadInput
from hsop_gcs.fleet import Fleet

ALL = "all"
MAX_NAMED = 250
"""No fleet has more hosts: system ids end there."""

HostId = Annotated[str, Field(min_length=1, max_length=64)]


def _list_or_all(value: object) -> object:
    if value == ALL:
        return None
    if not isinstance(value, list):
        raise ValueError(f'must be a list of hosts\' ids, or "{ALL}"')
    return value


NamedHosts = Annotated[
    list[HostId] | None,
    Field(min_length=1, max_length=MAX_NAMED),
    BeforeValidator(_list_or_all),
    WithJsonSchema(
        {
            "anyOf": [
                {"const": ALL, "type": "string"},
                {
                    "type": "array",
                    "items": {"type": "string", "minLength": 1, "maxLength": 64},
                    "minItems": 1,
                    "maxItems": MAX_NAMED,
                },
            ],
            "description": f'ids of hosts; "{ALL}": every host of the fleet',
        }
    ),
]
"""Some hosts by their ids; None: all of them, and somebody has said so."""


def distinct(names: Sequence[str] | None, fleet: Fleet) -> list[str] | None:
    """Return each name once. Raises BadInput if they are more than there are hosts."""
    if names is None:
        return None
    once = list(dict.fromkeys(names))
    if len(once) > len(fleet.hosts):
        raise BadInput("hosts", f"{len(once)} hosts are named, and the fleet has {len(fleet.hosts)}")
    return once


class _BoundedRequest(Request):
    async def json(self) -> Any:
        body = await super().json()
        if isinstance(body, dict) and len(body) > MAX_FIELDS:
            raise TooManyFields(len(body), MAX_FIELDS)
        return body


class BoundedRoute(APIRoute):
    """A route that refuses a body with too many fields before each of them is found to be unknown."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        handle = super().get_route_handler()

        async def handle_bounded(request: Request) -> Response:
            return await handle(_BoundedRequest(request.scope, request.receive))

        return handle_bounded
