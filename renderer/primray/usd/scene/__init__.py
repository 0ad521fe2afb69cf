"""What is drawn of a stage: prims with the state they inherit, the walk that finds them, and the scene they become."""
