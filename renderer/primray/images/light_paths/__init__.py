"""AOVs of light path expressions."""
