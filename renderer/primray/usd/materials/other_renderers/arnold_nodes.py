"""Arnold's colour and number nodes: arithmetic, mixtures, corrections, conversions (Arnold User Guide, "Shaders").

Rules return colours or numbers; a node's alpha is computed where its output `a` is read.
"""

from __future__ import annotations

from collections.abc import Callable

from ....description import Operand
from ..materialx.expressions import Outputs
from . import maths
from .maths import BLACK, ONE, WHITE, ZERO
from .values import RendererInputs

Rule = Callable[[RendererInputs], Operand | Outputs | None]
_LAYERS = 8


def _two(operation: str, first: float, second: float, names: tuple[str, str] = ("input1", "input2")) -> Rule:
    """Return the rule of an operation on two colours, with their defaults."""
    return lambda n: maths.binary(n.e, operation, n.color(names[0], first), n.color(names[1], second))


def _one(operation: str, **others: Operand) -> Rule:
    """Return the rule of a function of each channel of `input`."""
    return lambda n: n.e.apply(f"ND_{operation}_color3", **{"in": n.color("input", 0.0), **others})


def _vector(operation: str) -> Rule:
    """Return the rule of a function of each channel that MaterialX defines only for vectors."""

    def rule(n: RendererInputs) -> Operand:
        as_vector = n.e.apply("ND_convert_color3_vector3", **{"in": n.color("input", 0.0)})
        made = n.e.apply(f"ND_{operation}_vector3", **{"in": as_vector})
        return n.e.apply("ND_convert_vector3_color3", **{"in": made})

    return rule


def _negated(n: RendererInputs) -> Operand:
    return maths.scaled(n.e, n.color("input", 0.0), (-1.0,))


def _reciprocal(n: RendererInputs) -> Operand:
    return maths.binary(n.e, "divide", WHITE, n.color("input", 1.0))


def _clamped(n: RendererInputs) -> Operand:
    given = n.color("input", 1.0)
    if n.choice("mode", ("scalar", "color"), "scalar") == "color":
        low, high = n.color("min_color", 0.0), n.color("max_color", 1.0)
        return n.e.apply("ND_clamp_color3", **{"in": given, "low": low, "high": high})
    return n.e.apply("ND_clamp_color3FA", **{"in": given, "low": n.number("min", 0.0), "high": n.number("max", 1.0)})


def _mix_rgba(n: RendererInputs) -> Operand:
    by = n.number("mix", 0.5)
    if n.wants_alpha:
        return n.e.apply("ND_mix_float", bg=n.alpha("input1", 0.0), fg=n.alpha("input2", 1.0), mix=by)
    return maths.mixed(n.e, n.color("input1", 0.0), n.color("input2", 1.0), by)


def _color_correct(n: RendererInputs) -> Operand:
    """Apply gamma, hue, saturation, contrast, exposure, multiply and add, in this order; `mask` blends it with the input."""
    mask = n.number("mask", 1.0)
    given = n.color("input", 0.0)
    if n.wants_alpha:
        return _corrected_alpha(n, given, mask)
    e, made = n.e, given
    made = maths.with_gamma(e, made, n.number("gamma", 1.0))
    made = maths.with_hue(e, made, n.number("hue_shift", 0.0))
    made = maths.with_saturation(e, made, n.number("saturation", 1.0))
    made = maths.with_contrast(e, made, n.number("contrast", 1.0), n.number("contrast_pivot", 0.18))
    made = maths.exposed(e, made, n.number("exposure", 0.0))
    made = maths.binary(e, "multiply", made, n.color("multiply", 1.0))
    made = maths.binary(e, "add", made, n.color("add", 0.0))
    made = maths.inverted(e, made) if n.is_on("invert") else made
    n.asked |= {"invert_alpha", "alpha_is_luminance", "alpha_multiply", "alpha_add"}  # they affect only alpha
    return maths.mixed(e, given, made, mask)


def _corrected_alpha(n: RendererInputs, given: Operand, mask: Operand) -> Operand:
    e, own = n.e, n.alpha("input")
    n.asked |= {"gamma", "hue_shift", "saturation", "contrast", "contrast_pivot", "exposure", "multiply", "add", "invert"}
    alpha = maths.weighted(e, given, maths.LUMA) if n.is_on("alpha_is_luminance") else own
    alpha = n.reader.one_minus(alpha) if n.is_on("invert_alpha") else alpha
    alpha = e.apply("ND_multiply_float", in1=alpha, in2=n.number("alpha_multiply", 1.0))
    alpha = e.apply("ND_add_float", in1=alpha, in2=n.number("alpha_add", 0.0))
    return e.apply("ND_mix_float", bg=own, fg=alpha, mix=mask)


def _range(n: RendererInputs) -> Operand:
    """Remap from one range to another, with contrast about a pivot; Schlick's bias and gain are ignored."""
    e, low, high = n.e, n.number("input_min", 0.0), n.number("input_max", 1.0)
    off = e.apply("ND_subtract_color3FA", in1=n.color("input", 0.0), in2=low)
    made = e.apply("ND_divide_color3FA", in1=off, in2=e.apply("ND_subtract_float", in1=high, in2=low))
    if n.is_on("smoothstep"):
        made = e.apply("ND_smoothstep_color3FA", **{"in": made, "low": ZERO, "high": ONE})
    made = maths.with_contrast(e, made, n.number("contrast", 1.0), n.number("contrast_pivot", 0.5))
    if any(n.number(name, 0.5) != (0.5,) for name in ("bias", "gain")):
        n.lost |= {"bias", "gain"}
    out_low, out_high = n.number("output_min", 0.0), n.number("output_max", 1.0)
    made = maths.scaled(e, made, e.apply("ND_subtract_float", in1=out_high, in2=out_low))
    return e.apply("ND_add_color3FA", in1=made, in2=out_low)


def _layered(n: RendererInputs) -> Operand:
    """Composite the enabled layers, each over those of higher numbers, by its mix; unsupported operations overwrite."""
    value: Operand = BLACK
    alpha: Operand = ZERO
    for i in range(_LAYERS, 0, -1):
        if n.is_on(f"enable{i}", True):
            mix, color = n.number(f"mix{i}", 1.0), n.color(f"input{i}", 0.0)
            own = n.alpha(f"input{i}") if n.wants_alpha else ONE
            value = maths.mixed(n.e, value, _blended(n, f"operation{i}", value, color), mix)
            alpha = n.e.apply("ND_mix_float", bg=alpha, fg=own, mix=mix)
        else:
            n.asked |= {f"{name}{i}" for name in ("mix", "input", "operation")}
        n.asked |= {f"{name}{i}" for name in ("name", "alpha_operation")}
    return alpha if n.wants_alpha else value


def _blended(n: RendererInputs, name: str, below: Operand, color: Operand) -> Operand:
    e = n.e
    known: dict[str, Callable[[], Operand]] = {
        "overwrite": lambda: color,
        "normal": lambda: color,
        "multiply": lambda: maths.binary(e, "multiply", below, color),
        "add": lambda: maths.binary(e, "add", below, color),
        "plus": lambda: maths.binary(e, "add", below, color),
        "subtract": lambda: maths.binary(e, "subtract", below, color),
        "min": lambda: maths.binary(e, "min", below, color),
        "max": lambda: maths.binary(e, "max", below, color),
        "average": lambda: maths.mixed(e, below, color, (0.5,)),
        "screen": lambda: e.apply("ND_screen_color3", fg=color, bg=below, mix=ONE),
        "difference": lambda: e.apply("ND_difference_color3", fg=color, bg=below, mix=ONE),
    }
    said = n.text(name, "overwrite")
    if said not in known:
        n.lost.add(name)
    return known.get(said, known["overwrite"])()


def _switched(n: RendererInputs) -> Operand:
    index = int(n.constants("index", 0.0)[0])
    n.asked |= {f"input{i}" for i in range(20)}
    return n.alpha(f"input{index}") if n.wants_alpha else n.color(f"input{index}", 0.0)


def _shuffled(n: RendererInputs) -> Operand:
    """Return a colour whose channels are chosen from those of `color` and `alpha`."""
    choices = ("r", "g", "b", "a")
    color, alpha = n.color("color", 1.0), n.number("alpha", 1.0)
    made = []
    for letter in choices:
        chosen = n.choice(f"channel_{letter}", choices, letter)
        part = alpha if chosen == "a" else maths.channel(n.e, color, choices.index(chosen))
        made.append(n.reader.one_minus(part) if n.is_on(f"negate_{letter}") else part)
    if n.wants_alpha:
        return made[3]
    same = made[:3] == [maths.channel(n.e, color, i) for i in range(3)]
    return color if same else n.e.apply("ND_combine3_color3", in1=made[0], in2=made[1], in3=made[2])


def _of_parts(n: RendererInputs) -> Operand:
    if n.wants_alpha:
        return n.number("a", 1.0)
    return n.e.apply("ND_combine3_color3", **{f"in{i}": n.number(name) for i, name in enumerate("rgb", 1)})


def _to_number(n: RendererInputs) -> Operand:
    """Return a colour's average, sum, minimum, maximum, luminance, or one of its channels."""
    modes = ("min", "max", "average", "sum", "luminance", "r", "g", "b", "a")
    mode, e, color = n.choice("mode", modes, "average"), n.e, n.color("input", 0.0)
    if mode == "a":
        return n.alpha("input")
    if mode in ("average", "sum", "luminance"):
        weights = {"average": (1 / 3, 1 / 3, 1 / 3), "sum": WHITE, "luminance": maths.LUMA}
        return maths.weighted(e, color, weights[mode])
    parts = [maths.channel(e, color, i) for i in range(3)]
    if mode in ("r", "g", "b"):
        return parts["rgb".index(mode)]
    return e.apply(f"ND_{mode}_float", in1=parts[0], in2=e.apply(f"ND_{mode}_float", in1=parts[1], in2=parts[2]))


def _converted(n: RendererInputs) -> Operand:
    """Convert between RGB and HSV; other colour spaces are ignored."""
    spaces = ("RGB", "HSV")
    given, before, after = n.color("input", 0.0), n.choice("from", spaces, "RGB"), n.choice("to", spaces, "RGB")
    if before == after:
        return given
    return n.e.apply("ND_rgbtohsv_color3" if after == "HSV" else "ND_hsvtorgb_color3", **{"in": given})


def _trigonometric(n: RendererInputs) -> Operand:
    functions = ("cos", "sin", "tan", "acos", "asin", "atan", "cosh", "sinh", "tanh")
    name = n.choice("function", functions, "cos")
    if name not in ("cos", "sin", "tan", "acos", "asin"):
        n.lost.add("function")
        name = "cos"
    e = n.e
    angle = maths.scaled(e, n.color("input", 0.0), n.number("frequency", 1.0))
    angle = e.apply("ND_add_color3FA", in1=angle, in2=n.number("phase", 0.0))
    if n.choice("units", ("radians", "degrees"), "radians") == "degrees":
        angle = maths.scaled(e, angle, (0.017453292519943295,))
    as_vector = e.apply("ND_convert_color3_vector3", **{"in": angle})
    made = e.apply(f"ND_{name}_vector3", **{"in": as_vector})
    return e.apply("ND_convert_vector3_color3", **{"in": made})


def _compared(n: RendererInputs) -> Operand:
    tests = ("==", "!=", ">", "<", ">=", "<=")
    test, a, b = n.choice("test", tests, "=="), n.number("input1"), n.number("input2")
    kind = {"==": "equal", "!=": "equal", ">": "greater", "<=": "greater", ">=": "greatereq", "<": "greatereq"}[test]
    yes, no = (ONE, ZERO) if test in ("==", ">", ">=") else (ZERO, ONE)
    return n.e.apply(f"ND_if{kind}_float", value1=a, value2=b, in1=yes, in2=no)


def _dot(n: RendererInputs) -> Operand:
    return n.e.apply("ND_dotproduct_vector3", in1=n.vector("input1", 0.0), in2=n.vector("input2", 0.0))


def _cross(n: RendererInputs) -> Operand:
    return n.e.apply("ND_crossproduct_vector3", in1=n.vector("input1", 0.0), in2=n.vector("input2", 0.0))


def _length(n: RendererInputs) -> Operand:
    return n.e.apply("ND_magnitude_vector3", **{"in": n.vector("input", 0.0)})


def _normalized(n: RendererInputs) -> Operand:
    return n.e.apply("ND_normalize_vector3", **{"in": n.vector("input", 0.0)})


def _same(name: str, default: float = 0.0) -> Rule:
    """Return the rule of a node that passes a colour on."""
    return lambda n: n.alpha(name) if n.wants_alpha else n.color(name, default)


def _handed_on(name: str, *unread: str) -> Rule:
    """Return the rule of a node that passes a colour on, and whose other inputs do not affect the beauty image."""

    def rule(n: RendererInputs) -> Operand:
        n.asked |= set(unread)
        return n.alpha(name) if n.wants_alpha else n.color(name, 0.0)

    return rule


def _by_ray(n: RendererInputs) -> Operand:
    """Return what camera rays see; inputs for other rays are ignored."""
    return n.alpha("camera") if n.wants_alpha else n.color("camera", 0.0)


def _flat(n: RendererInputs) -> Operand:
    return ONE if n.wants_alpha else n.color("color", 1.0)


NODES: dict[str, Rule] = {
    "add": _two("add", 0.0, 0.0),
    "subtract": _two("subtract", 0.0, 0.0),
    "multiply": _two("multiply", 1.0, 1.0),
    "divide": _two("divide", 1.0, 1.0),
    "modulo": _two("modulo", 0.0, 1.0, ("input", "divisor")),
    "min": _two("min", 0.0, 0.0),
    "max": _two("max", 0.0, 0.0),
    "pow": _two("power", 0.0, 1.0, ("base", "exponent")),
    "abs": _one("absval"),
    "sign": _one("sign"),
    "complement": _one("invert", amount=WHITE),
    "fraction": _one("fract"),
    "sqrt": _vector("sqrt"),
    "exp": _vector("exp"),
    "log": _vector("ln"),
    "negate": _negated,
    "reciprocal": _reciprocal,
    "clamp": _clamped,
    "compare": _compared,
    "dot": _dot,
    "cross": _cross,
    "length": _length,
    "normalize": _normalized,
    "trigo": _trigonometric,
    "mix_rgba": _mix_rgba,
    "color_correct": _color_correct,
    "color_convert": _converted,
    "color_jitter": _handed_on("input"),
    "range": _range,
    "layer_rgba": _layered,
    "switch_rgba": _switched,
    "shuffle": _shuffled,
    "float_to_rgb": _of_parts,
    "float_to_rgba": _of_parts,
    "vector_to_rgb": _same("input"),
    "rgb_to_vector": _same("input"),
    "rgb_to_float": _to_number,
    "rgba_to_float": _to_number,
    "ray_switch_rgba": _by_ray,
    "passthrough": _handed_on("passthrough"),
    "aov_write_rgb": _handed_on("passthrough", "aov_input", "aov_name", "blend_opacity"),
    "aov_write_rgba": _handed_on("passthrough", "aov_input", "aov_name", "blend_opacity"),
    "aov_write_float": _handed_on("passthrough", "aov_input", "aov_name", "blend_opacity"),
    "flat": _flat,
}
