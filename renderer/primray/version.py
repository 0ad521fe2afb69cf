"""The version of primray: what builds, reports and files say."""

__version__ = "0.2.0"
