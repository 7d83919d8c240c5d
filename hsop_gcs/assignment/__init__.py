"""Assignment: which host flies to which hover point, by which route, when, and the order each one gets. Pure."""

from hsop_gcs.assignment.arrangement import Departure, NoSafeFlight, arrange, flight_s
from hsop_gcs.assignment.corridor import clear_of, inner, why_outside
from hsop_gcs.assignment.matching import assign
from hsop_gcs.assignment.orders import HostOrder, order_for, orders_for
from hsop_gcs.assignment.routes import (
    FlightRules,
    Mover,
    Route,
    clearance_m,
    gains_by_staying,
    safe_route,
    straight,
    why_unsafe,
)
from hsop_gcs.assignment.separation import Flight, in_the_way

__all__ = [
    "Departure",
    "Flight",
    "FlightRules",
    "HostOrder",
    "Mover",
    "NoSafeFlight",
    "Route",
    "arrange",
    "assign",
    "clear_of",
    "clearance_m",
    "flight_s",
    "gains_by_staying",
    "in_the_way",
    "inner",
    "order_for",
    "orders_for",
    "safe_route",
    "straight",
    "why_outside",
    "why_unsafe",
]
