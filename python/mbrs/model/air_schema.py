"""The numbers of air around blades, and the headings of a file."""

from __future__ import annotations

from .schema import (
    BODY,
    CONSTRAINT,
    COUPLER,
    DRIVE,
    ELEMENTS,
    FLEXIBLE_BODY,
    JOINTS,
    LOADS,
    MARKER,
    VELOCITY_CONSTRAINT,
    Argument,
    Block,
    Field,
    Kind,
)

AIR = Kind(
    "aerodynamics",
    "aerodynamics",
    Block(
        "air",
        [
            Field("density", (), "density", check="positive"),
            Field("speed", (), "velocity", check="not negative", note="of the wind at the reference height"),
            Field("shear", (), "ratio", check="not negative", note="exponent of the height over the reference height"),
            Field("reference_height", (), "length", check="positive", default=1.0),
            Field("direction", (3,), "direction", (1.0, 0.0, 0.0), note="where the wind blows to, world"),
            Field("up", (3,), "direction", (0.0, 0.0, 1.0), note="along which height counts from the ground"),
            Field("axis", (3,), "direction", (1.0, 0.0, 0.0), note="of the annuli, down the wind, world, as drawn"),
            Field("pitch", (), "angle", note="added to the twist of all sections"),
            Field("ground", (), "length", note="along `up`, where height is zero"),
            Field(
                "stall", (), "ratio", check="positive", default=4.0, note="lag of dynamic stall, in chords of the flow"
            ),
        ],
    ),
    (
        Argument("name", "text", True),
        Argument("blades", "data", True),
        Argument("wind", "wind", True),
        Argument("density"),
        Argument("inflow", "text"),
        Argument("coupling", "text"),
        Argument("axis", "direction"),
        Argument("pitch"),
        Argument("attached", "data"),
        Argument("stall"),
        Argument("polars", "data"),
        Argument("options", "data"),
    ),
)
SECTION = Block(
    "section",
    [
        Field("position", (3,), "position", note="of the blade's line, body axes, from the origin"),
        Field("width", (), "length", note="of its strip"),
        Field("chord", (), "length"),
        Field("twist", (), "angle", note="to the body's y axis, positive into -z"),
        Field("centre", (), "length", note="aerodynamic centre ahead of the line"),
        Field("rear", (), "length", note="three quarters of the chord ahead of the line"),
        Field("share", (), "ratio", note="of the second polar"),
        Field("solidity", (), "ratio", note="blades times chord over the circumference"),
        Field("loss", (2,), "ratio", note="exponents of the losses at tip and hub, over |sin phi|; zero: none"),
        Field("radius", (), "length", note="of the rotor"),
        Field("span", (), "ratio", note="of the section's radius to the rotor's"),
        Field("slope", (), "ratio", note="of the lift in attached flow, 1/rad"),
        Field("zero", (), "angle", note="of attack at which there is no lift"),
    ],
    "of each section of a blade",
)
INFLOWS = {"given": 0, "momentum": 1}
# Bits: the laws with states of the sections.
UNSTEADY = {"inflow": 1, "attached": 2, "stall": 4}

# The kinds of a file by heading, in its order.
HEADINGS = {
    "body": {"body": BODY, "flexible_body": FLEXIBLE_BODY},
    "joint": JOINTS,
    "drive": {"drive": DRIVE},
    "coupler": {"coupler": COUPLER},
    "constraint": {"constraint": CONSTRAINT},
    "velocity_constraint": {"velocity_constraint": VELOCITY_CONSTRAINT},
    "element": ELEMENTS,
    "load": LOADS,
    "marker": {"marker": MARKER},
    "aerodynamics": {"aerodynamics": AIR},
}
