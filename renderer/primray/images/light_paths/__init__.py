"""Outputs of light path expressions."""
