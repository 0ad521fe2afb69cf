"""Nodes of MaterialX's PBR library that are plain functions: roughness, metal colours, black-body colour, hair."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..program import Node, Outputs, Program, Value

SMALL = 1e-8
COLDEST, HOTTEST = 800.0, 25000.0
# Chromaticity x from 1000 K / T below 4000 K and above; y from x below 2222 K, below 4000 K and above. Kang et al. 2002,
# "Design of Advanced Color Temperature Control System for HDTV Applications".
X_OF_COLD, X_OF_HOT = (-0.2661239, -0.2343580, 0.8776956, 0.179910), (-3.0258469, 2.1070379, 0.2226347, 0.240390)
Y_BELOW_2222 = (-1.1063814, -1.34811020, 2.18555832, -0.20219683)
Y_BELOW_4000 = (-0.9549476, -1.37418593, 2.09137015, -0.16748867)
Y_ABOVE = (3.0817580, -5.87338670, 3.75112997, -0.37001483)
RGB_OF_XYZ = ((3.2406, -1.5372, -0.4986), (-0.9689, 1.8758, 0.0415), (0.0557, -0.2040, 1.0570))
# Chiang et al. 2016, "A Practical and Controllable Hair and Fur Model for Production Path Tracing", formulas 7 to 9.
ABSORPTION = (0.245, 5.574, -10.73, 2.532, -0.215, 5.969)


def _polynomial(x: Value, coefficients: Sequence[float]) -> Value:
    """Evaluate a polynomial by Horner's rule; the highest power's coefficient is first."""
    result = x * coefficients[0] + coefficients[1]
    for c in coefficients[2:]:
        result = result * x + c
    return result


def _power(x: Value, exponent: int) -> Value:
    result = x
    for _ in range(exponent - 1):
        result = result * x
    return result


def roughness_anisotropy(n: Node) -> Value:
    p, a = n.program, n["anisotropy"]
    square = p.clamp(n["roughness"] * n["roughness"], SMALL, 1.0)
    aspect = p.sqrt(1.0 - p.clamp(a, 0.0, 0.98))
    return p.pack([p.apply("min", square / aspect, 1.0), square * aspect])


def roughness_dual(n: Node) -> Value:
    p, r = n.program, n["roughness"]
    both = p.pack([r[0], p.select(p.less(r[1], 0.0), r[0], r[1])])
    return p.clamp(both * both, SMALL, 1.0)


def artistic_ior(n: Node) -> dict[str, Value]:
    """Compute a metal's IOR by Gulbrandsen 2014, "Artist Friendly Metallic Fresnel" (JCGT 3 (4))."""
    p = n.program
    r = p.clamp(n["reflectivity"], 0.0, 0.99)
    root = p.sqrt(r)
    ior = p.mix((1.0 + root) / (1.0 - root), (1.0 - r) / (1.0 + r), n["edge_color"])
    above, below = ior + 1.0, ior - 1.0
    return {"ior": ior, "extinction": p.sqrt((above * above * r - below * below) / (1.0 - r))}


def blackbody(n: Node) -> Value:
    p = n.program
    kelvin = p.clamp(n["temperature"], COLDEST, HOTTEST)
    t = 1000.0 / kelvin
    is_cold = p.less(kelvin, 4000.0)
    x = p.select(is_cold, _polynomial(t, X_OF_COLD), _polynomial(t, X_OF_HOT))
    cold = p.select(p.less(kelvin, 2222.0), _polynomial(x, Y_BELOW_2222), _polynomial(x, Y_BELOW_4000))
    y = p.select(is_cold, cold, _polynomial(x, Y_ABOVE))
    xyz = p.pack([x / y, p.constant(1.0), (1.0 - x - y) / y])
    rgb = p.pack([p.dot(xyz, p.constant(*row)) for row in RGB_OF_XYZ])
    return p.apply("max", rgb, 0.0)


def hair_roughness(n: Node) -> dict[str, Value]:
    p = n.program
    along, around = p.clamp(n["longitudinal"], 0.001, 1.0), p.clamp(n["azimuthal"], 0.001, 1.0)
    variance = along * 0.726 + along * along * 0.812 + _power(along, 20) * 3.7
    variance = variance * variance
    logistic = around * 0.265 + around * around * 1.194 + _power(around, 22) * 5.372

    def scaled(name: str) -> Value:
        return p.pack([variance * n[name] * n[name], logistic])

    plain = p.pack([variance, logistic])
    return {"roughness_R": plain, "roughness_TT": scaled("scale_TT"), "roughness_TRT": scaled("scale_TRT")}


def _ln(p: Program, x: Value) -> Value:
    return p.apply("ln", x)


def hair_absorption_of_color(n: Node) -> Value:
    p = n.program
    sigma = _ln(p, p.clamp(n["color"], 0.001, 1.0)) / _polynomial(n["azimuthal_roughness"], ABSORPTION)
    return sigma * sigma


def hair_absorption_of_melanin(n: Node) -> Value:
    """Compute absorption by d'Eon et al. 2011, "An Energy-Conserving Hair Reflectance Model"."""
    p, red = n.program, n["melanin_redness"]
    melanin = 0.0 - _ln(p, p.apply("max", 1.0 - n["melanin_concentration"], 0.0001))
    dark, light = melanin * (1.0 - red), melanin * red
    absorbed = _ln(p, n["eumelanin_color"]) * dark + _ln(p, n["pheomelanin_color"]) * light
    return p.apply("max", 0.0 - absorbed, 0.0)


PBR_NODES: dict[str, Callable[[Node], Outputs]] = {
    "roughness_anisotropy": roughness_anisotropy, "roughness_dual": roughness_dual, "artistic_ior": artistic_ior,
    "blackbody": blackbody, "chiang_hair_roughness": hair_roughness,
    "chiang_hair_absorption_from_color": hair_absorption_of_color,
    "deon_hair_absorption_from_melanin": hair_absorption_of_melanin,
}  # fmt: skip
