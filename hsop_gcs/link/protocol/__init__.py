"""The machines without I/O, one micro-protocol each.

All share five words: ``receive(message, now)``, ``advance(now)``, ``wake_at``, ``take_outgoing()``, ``take_events()``.
Machines that send commands hand them to the vehicle's one ``CommandSender`` and get the ends by ``settle(outcome, now)``.
"""
