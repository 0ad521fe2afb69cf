"""UsdGeomCurves as cubic Bezier curves: layout of values on curves (curve_set), conversion from each schema's form (basis,
hermite, nurbs) and reading of prims (authored, values, moving)."""
