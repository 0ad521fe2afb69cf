"""UsdGeomCurves as cubic Bezier curves: layout of values on curves (curve_set), conversion from each schema's form (basis,
usd/nurbs/curves), reading of prims (authored, values) and the adapters for them."""
