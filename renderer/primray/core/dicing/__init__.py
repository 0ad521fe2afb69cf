"""Upload of displacement for dicing, beside the cages themselves."""
