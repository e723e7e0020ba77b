"""Recorded hand paths through other renderers, and through the one that was recorded.

Playing a recorded path back is open loop: the hand would have reacted to another force. `OPEN_LOOP` says so wherever
a result of a replay is shown.
"""

OPEN_LOOP = (
    "Open loop: the recorded hand path is given, and does not react. "
    "Under this renderer's force the hand would have moved otherwise."
)

RECORDED = "recorded"
"""The name of the column that holds the recorded run itself."""
