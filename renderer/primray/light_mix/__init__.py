"""Lights changed after the render: `parts` keeps the light of each apart, `mix` weighs and adds it, `fit` finds weights."""
