"""From a stimulus to a recording: playback of a path, and the closed loop of a device."""
