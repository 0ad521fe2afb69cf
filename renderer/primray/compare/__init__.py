"""Have two pictures changed, beyond their noise? Differences, tests of them, a verdict, and the pytest fixture."""
