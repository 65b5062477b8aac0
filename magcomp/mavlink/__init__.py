"""MAVLink itself: headers, checksums, framing, who a heartbeat is from, and how parameters travel.

The only room that takes a frame apart; every other one asks it.
"""
