"""`primray sheet`: what it runs, and the page of what came of it."""
