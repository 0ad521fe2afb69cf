"""What stays of a translation from one render to the next, and which edits of the stage it outlives."""

from .changes import Changes, StageChanges
from .translation import KeptTranslation

__all__ = ["Changes", "KeptTranslation", "StageChanges"]
