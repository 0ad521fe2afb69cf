"""UsdGeomCurves as cubic Bezier curves: layout of values on curves and conversion from basis and Hermite curves (bezier), from
NURBS (nurbs), widths, normals and primvars (values), and the adapters."""
