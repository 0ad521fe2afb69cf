"""The version of primray, as used by the build, by reports and in file headers."""

__version__ = "0.2.0"
