"""Image files to texels of the rendering space, and photometric files to profiles. Knows neither USD nor the core."""
