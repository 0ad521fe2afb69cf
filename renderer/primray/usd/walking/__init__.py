"""Going down the stage, and where groups of instances stand."""
