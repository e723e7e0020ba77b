"""Cases x renderers -> recordings -> verdicts -> results on disk, reported as one stream of events."""
