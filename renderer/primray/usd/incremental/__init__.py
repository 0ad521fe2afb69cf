"""Incremental translation: what of a translation stays valid after edits of the stage, from one render to the next."""

from .translation import KeptTranslation
from .updates import Changes, StageChanges

__all__ = ["Changes", "KeptTranslation", "StageChanges"]
