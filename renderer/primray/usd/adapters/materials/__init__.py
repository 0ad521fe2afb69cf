"""Surfaces of shapes: translation of UsdShade materials, and displayColor where no material is bound."""
