"""Incremental translation: what of a translation stays valid after edits of the stage, from one render to the next."""

from .changes import Changes, StageChanges
from .translation import KeptTranslation

__all__ = ["Changes", "KeptTranslation", "StageChanges"]
