"""What the core is given to dice with, beside cages."""
