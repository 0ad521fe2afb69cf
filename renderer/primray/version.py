"""The version of primray: what builds, reports and files say."""

__version__ = "0.1.0"
