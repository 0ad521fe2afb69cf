"""NurbsPatch prims as authored, checked: directions, weights and trim curves that fit, and what was wrong with others."""
