"""primray renders USD stages on CPUs and returns images with their error. `usd` translates, `render` runs the core."""

__version__ = "0.1.0"
