"""UsdGeomCurves as cubic Bezier curves: which values stand where (curve_set), from each kind's own form (basis, hermite), and
what is read of a prim (authored, widths, values)."""
