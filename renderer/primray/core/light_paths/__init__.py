"""Upload of light path expressions to the core."""
