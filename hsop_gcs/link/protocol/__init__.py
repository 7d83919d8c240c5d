"""The machines without I/O, one micro-protocol each.

All share five words: ``receive(message, now)``, ``advance(now)``, ``wake_at``, ``take_outgoing()``, ``take_events()``.
Machines with commands to send hand them to the vehicle's one ``CommandSender`` and hear the end by ``settle(outcome)``.
"""
