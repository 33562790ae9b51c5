"""Write the C++ headers of the fields of a world: `python write_fields.py`.

The headers contain names, sizes, and the valid ranges of values in snapshots, generated from the declarations
in Python.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from taichi_soft.bodies import status
from taichi_soft.bodies.asset import REST_WIDTH
from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.contact.fields import PAIR_ROWS
from taichi_soft.contact.kernels.touches import OF_BODY, OF_COLLIDER
from taichi_soft.control.embedding import FARTHEST
from taichi_soft.control.grab_patch import STRONGEST
from taichi_soft.control.joints import DRAW, SPREAD
from taichi_soft.control.kernels.grabs import CORNERS, MOST_GRABS, PATCH_ROWS
from taichi_soft.control.kernels.joints import ENDS, JOINT_ROWS, MOST_JOINTS
from taichi_soft.control.kernels.motors import MOST_MOTORS, MOTOR_ROWS
from taichi_soft.control.kernels.pins import FRAME_WIDTH
from taichi_soft.control.motors import LARGEST_LIMIT, THINNEST
from taichi_soft.core.constants import LANES, NEAR
from taichi_soft.core.field_table import (
    BODY,
    COLLIDER,
    FINITE,
    FRAME,
    PARTICLE,
    WORLD,
    Below,
    Declaration,
    FieldGroup,
)
from taichi_soft.core.runtime import ti
from taichi_soft.solver.state import State

SOURCES = Path(__file__).parent / "src"

NOTICE = """\
// {}. Written by engine_adapter/native/write_fields.py from the declarations
// in Python: do not edit.
// clang-format off
#pragma once
"""

CONSTANTS = {
    "kLanes": LANES,
    "kNear": NEAR,
    "kFrameWidth": FRAME_WIDTH,
    "kRestWidth": REST_WIDTH,
    "kMostGrabs": MOST_GRABS,
    "kPatchRows": PATCH_ROWS,
    "kStrongest": STRONGEST,
    "kGrabCorners": CORNERS,
    "kMostJoints": MOST_JOINTS,
    "kJointRows": JOINT_ROWS,
    "kJointEnds": ENDS,
    "kSpread": SPREAD,
    "kMostMotors": MOST_MOTORS,
    "kMotorRows": MOTOR_ROWS,
    "kPairRows": PAIR_ROWS,
    "kFarthest": FARTHEST,
    "kDraw": DRAW,
    "kLargestLimit": LARGEST_LIMIT,
    "kThinnest": THINNEST,
}

STATUS = ("ACTIVE", "FROZEN", "ASLEEP", "SKIPPING", "ABSENT", "DISABLED", "FROZEN_DISABLED")
DRIVES = ("MOVES_PINS", "FEELS_REACTION", "DAMPED", "SHELTERED", "GRABBED", "JOINED")
AIMS = ("STILL", "TO_TARGET", "ARRIVED", "WITH_FRAME")
ENUMS = {
    **{
        name: {each: getattr(status, each) for each in members}
        for name, members in (("Status", STATUS), ("Drives", DRIVES), ("Aims", AIMS))
    },
    "Touched": {"OF_COLLIDER": OF_COLLIDER, "OF_BODY": OF_BODY},
    "GridShapes": {"HEIGHT_FIELD": ShapeKind.HEIGHT_FIELD, "MESH_SHAPE": ShapeKind.MESH},
}

COUNTS = {WORLD: "1", BODY: "bodies", PARTICLE: "particles", COLLIDER: "collider_room"}
"""For each value of `rows` in a field's declaration, the C++ expression for the field's number of rows."""

CONDITIONS = {
    "": "",
    "has_contact": "",
    "has_soft_contact": "has_soft_contact",
    "implicit": "is_implicit",
    "rods": "has_rods",
}
"""For each value of `when` in a field's declaration, the member of `Scene` that is true if the scene has the
field. The member is empty if every scene has the field. Every exported world has contact."""

THINGS = {"": "kNothing", PARTICLE: "kParticles", BODY: "kBodies", COLLIDER: "kColliders", FRAME: "kFrames"}


def headers() -> dict[str, str]:
    """Return the text of each header, by file name."""
    return {"constants.hpp": _constants_header(), "fields.hpp": _fields_header()}


def _constants_header() -> str:
    constants = "\n".join(
        f"constexpr {'size_t' if isinstance(value, int) else 'double'} {name} = {value!r};"
        for name, value in CONSTANTS.items()
    )
    enums = "\n".join(
        f"enum {name} {{ {', '.join(f'{_constant(key)} = {int(n)}' for key, n in members.items())} }};"
        for name, members in ENUMS.items()
    )
    return f"""\
{NOTICE.format("Numbers that fields depend on")}
#include <cstddef>

namespace taichi_soft {{

{constants}

{enums}

}}  // namespace taichi_soft
"""


def _fields_header() -> str:
    return f"""\
{NOTICE.format("Fields of a world, and the bounds of their numbers in snapshots")}
#include <limits>

#include "scene.hpp"

namespace taichi_soft {{

// Numbers of a field in memory.
template <typename Number>
class Field {{
 public:
  Field() = default;
  Field(char* root, const Place& place) : first_(root + place.offset), stride_(place.stride) {{}}
  Number& operator()(size_t i, size_t k = 0) const {{
    return reinterpret_cast<Number*>(first_ + i * stride_)[k];
  }}

 private:
  char* first_ = nullptr;
  size_t stride_ = 0;
}};

struct Fields {{
{"".join(_members())}
  Fields() = default;
  // Fails if a field is missing, or too short.
  Fields(char* root, const Scene& scene, size_t collider_room) {{
    const size_t bodies = size_t(scene.slot_count), particles = size_t(scene.particle_count);
{"".join(_bindings())}  }}
}};

// Bounds of a field. Integers are at least 0 and less than the number of `things` plus `beside`. The absolute
// values of floats are at most `most`; infinity means no bound.
struct Bound {{
  enum Things {{ {", ".join(THINGS.values())} }};
  const char* field;
  Things things;
  int beside;
  float most;
}};

constexpr float kAny = std::numeric_limits<float>::infinity(), kFinite = std::numeric_limits<float>::max();
constexpr Bound kBounds[] = {{
{"".join(_bounds())}}};

}}  // namespace taichi_soft
"""


def _constant(name: str) -> str:
    return "k" + name.title().replace("_", "")


def _groups() -> Iterator[tuple[str, type[FieldGroup]]]:
    yield "", State
    yield from State.GROUPS.items()


def _members() -> Iterator[str]:
    """Yield the lines that declare the fields. Each group is a struct with the group's name."""
    for prefix, group in _groups():
        inner = "  " if prefix else ""
        lines = []
        for name, each in group.declarations().items():
            if not each.native:
                continue
            if each.is_struct:
                of_struct = "".join(
                    f"    {inner}Field<{_type(number)}> {key};\n"
                    for key, number in each.number.members.items()
                )
                lines.append(f"{inner}  struct {{\n{of_struct}{inner}  }} {name};\n")
            else:
                lines.append(f"{inner}  Field<{_type(each.number)}> {name};\n")
        if lines:
            yield f"  struct {{\n{''.join(lines)}  }} {prefix};\n" if prefix else "".join(lines)


def _bindings() -> Iterator[str]:
    """Yield the lines that bind the fields to their addresses in memory."""
    for prefix, group in _groups():
        for name, each in group.declarations().items():
            if not each.native:
                continue
            path = f"{prefix}.{name}" if prefix else name
            members = each.number.members.items() if each.is_struct else [("", each.number)]
            for key, number in members:
                whole = f"{path}.{key}" if key else path
                width = getattr(number, "n", 1) if key else each.size
                line = f'{whole} = {{root, scene.place("{whole}", {_count(each)}, {width})}};'
                condition = CONDITIONS[each.when or group.when]
                yield f"    if (scene.{condition}) {line}\n" if condition else f"    {line}\n"


def _bounds() -> Iterator[str]:
    for prefix, group in _groups():
        for name, each in group.declarations().items():
            path = f"{prefix}.{name}" if prefix else name
            if not (each.keep or each.native_keep) or not each.is_bounded:
                continue
            if each.is_struct:
                assert isinstance(each.below, dict)
                for key, number in each.number.members.items():
                    if _type(number) == "float" or key in each.below:
                        yield _bound(f"{path}.{key}", each.below.get(key), each.most)
            else:
                assert not isinstance(each.below, dict)
                yield _bound(path, each.below, each.most)


def _bound(path: str, below: Below | None, most: float) -> str:
    most_text = "kAny" if math.isinf(most) else "kFinite" if most == FINITE else f"{most:.1e}f"
    things, beside = (THINGS[below.things], below.beside) if below else (THINGS[""], 0)
    return f'    {{"{path}", Bound::{things}, {beside}, {most_text}}},\n'


def _type(number: object) -> str:
    plain = getattr(number, "dtype", number)  # `number` is a vector if a member has several components
    return "int32_t" if plain == ti.i32 else "float"


def _count(each: Declaration) -> str:
    if isinstance(each.rows, int):
        return str(each.rows * each.each)
    assert each.each == 1
    return COUNTS[each.rows]


if __name__ == "__main__":
    for name, text in headers().items():
        (SOURCES / name).write_text(text)
