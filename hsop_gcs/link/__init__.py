"""The vehicles' end of the service, over MAVLink.

    pump ──► router ──► vehicle ──► protocol machines ──► adapters
    sockets   peers,     one system   commands, hover,      what differs between
    and clock codec      id           gimbal, take-off      PX4 and ArduPilot

Only ``pump`` and ``transports`` know asyncio; only ``codec`` knows pymavlink; all between are machines without I/O.
"""
