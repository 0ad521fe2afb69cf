"""UsdRender: settings, products, variables and passes, and what they ask of a render."""
