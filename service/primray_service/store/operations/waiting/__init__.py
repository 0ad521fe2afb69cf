"""The queue: claims of frames, the order of turns, positions, and recent durations of work."""
