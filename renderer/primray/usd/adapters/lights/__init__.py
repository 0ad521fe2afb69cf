"""UsdLux: emission, shaping, shadows, links and visibility of lights."""
