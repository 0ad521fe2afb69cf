"""UsdRender: settings, products, outputs and passes."""
