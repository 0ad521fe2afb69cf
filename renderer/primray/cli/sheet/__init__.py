"""`primray sheet`: render processes, and the contact sheet of their results."""
