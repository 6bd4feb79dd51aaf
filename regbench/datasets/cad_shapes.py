"""The categories of `cad_demo`: each a function that draws its measures and returns its parts.

Every shape carries something that breaks its symmetry (a drawer, a key, a handle), so that most have one pose only.
z is up; lengths are arbitrary, since every cloud is scaled to the unit sphere.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from regbench.datasets.primitives import Triangles, box, cone, cylinder, extrude, place, revolve, sphere, torus

Parts = list[Triangles]


def _aeroplane(rng: np.random.Generator) -> Parts:
    length, radius, span = rng.uniform(3, 5), rng.uniform(0.22, 0.4), rng.uniform(3, 5)
    chord, sweep, tail = rng.uniform(0.5, 1.0), rng.uniform(0.2, 0.9), rng.uniform(0.6, 1.1)
    half = span / 2
    wing = extrude([(0, -half), (chord * 0.5, -half), (chord + sweep, 0), (chord * 0.5, half), (0, half)], 0.08)
    rudder = extrude([(-0.4, 0), (0.3, 0), (-0.2, tail), (-0.5, tail)], 0.06)
    parts = [
        place(cylinder(radius, length), turn_deg=(0, 90, 0)),
        place(cone(radius, radius * 0.2, radius * 2.5), (length / 2 + radius * 1.25, 0, 0), (0, 90, 0)),
        place(wing, (-chord / 2, 0, rng.uniform(-0.7, 0.7) * radius)),
        place(rudder, (-length / 2 + 0.4, 0, radius * 0.8), (90, 0, 0)),
        place(box(0.4, span * 0.35, 0.06), (-length / 2 + 0.25, 0, radius * 0.5)),
    ]
    engine = cylinder(radius * 0.45, chord * 0.9, 12)
    for side in (-1, 1):
        parts.append(place(engine, (chord / 3, side * span * rng.uniform(0.18, 0.3), -radius * 0.6), (0, 90, 0)))
    return parts


def _bolt(rng: np.random.Generator) -> Parts:
    head, height, shaft = rng.uniform(0.7, 1.1), rng.uniform(0.4, 0.7), rng.uniform(0.3, 0.5)
    length = rng.uniform(1.8, 3.5)
    angles = np.arange(6) * np.pi / 3
    hexagon = np.stack([head * np.cos(angles), head * np.sin(angles)], axis=1)
    pin, reach = rng.uniform(0.15, 0.28), rng.uniform(1.2, 2.2)
    return [
        place(extrude(hexagon, height), (0, 0, height / 2)),
        place(cylinder(shaft, length), (0, 0, -length / 2)),
        place(cylinder(shaft * 1.7, 0.12), (0, 0, -rng.uniform(0.1, 0.3) * length)),
        place(cylinder(pin, reach, 12), (reach / 2 + shaft * 0.5, 0, -rng.uniform(0.5, 0.9) * length), (0, 90, 0)),
    ]


def _bookshelf(rng: np.random.Generator) -> Parts:
    width, depth, height = rng.uniform(1.5, 3), rng.uniform(0.5, 0.9), rng.uniform(2.5, 4)
    shelves = int(rng.integers(3, 6))
    parts = [
        place(box(0.08, depth, height), (-width / 2, 0, height / 2)),
        place(box(0.08, depth, height), (width / 2, 0, height / 2)),
        place(box(width, 0.05, height), (0, depth / 2, height / 2)),
    ]
    for level in np.linspace(0, height, shelves + 1):
        parts.append(place(box(width, depth, 0.08), (0, 0, level)))
    for level in np.linspace(0, height, shelves + 1)[:-1]:
        filled, tall = rng.uniform(0.2, 0.9) * width, rng.uniform(0.5, 0.85) * height / shelves
        parts.append(place(box(filled, depth * 0.7, tall), (-width / 2 + filled / 2, 0.05, level + tall / 2)))
    return parts


def _bracket(rng: np.random.Generator) -> Parts:
    long, short, width = rng.uniform(2, 3.5), rng.uniform(1, 1.8), rng.uniform(0.8, 1.6)
    thick, boss = rng.uniform(0.12, 0.3), rng.uniform(0.15, 0.3)
    gusset = extrude([(0, 0), (long * 0.5, 0), (0, short * 0.7)], thick)
    return [
        place(box(long, width, thick), (long / 2, 0, 0)),
        place(box(thick, width, short), (0, 0, short / 2)),
        place(gusset, (0, width * rng.uniform(0.2, 0.45), 0), (90, 0, 0)),
        place(cylinder(boss, thick * 3), (long * rng.uniform(0.7, 0.85), -width * 0.2, thick)),
        place(torus(boss, thick * 0.4), (0, -width * 0.15, short * 0.7), (0, 90, 0)),
    ]


def _car(rng: np.random.Generator) -> Parts:
    length, width, height = rng.uniform(3.2, 4.5), rng.uniform(1.4, 1.8), rng.uniform(0.5, 0.7)
    cabin, wheel = rng.uniform(1.4, 2.2), rng.uniform(0.3, 0.42)
    profile = [(-cabin / 2, 0), (cabin / 2, 0), (cabin * rng.uniform(0.15, 0.35), 0.6), (-cabin * 0.4, 0.6)]
    parts = [
        box(length, width, height),
        place(extrude(profile, width * 0.9), (-length * rng.uniform(0.05, 0.15), 0, height / 2), (90, 0, 0)),
        place(box(0.3, width * 0.3, 0.15), (length / 2, width * 0.2, height * 0.2)),
        place(box(0.2, width, 0.08), (-length / 2 + 0.1, 0, height / 2 + rng.uniform(0.1, 0.4))),
    ]
    for x in (-0.32, 0.34):
        for side in (-0.5, 0.5):
            parts.append(place(cylinder(wheel, 0.22, 16), (x * length, side * width, -height / 2), (90, 0, 0)))
    return parts


def _chair(rng: np.random.Generator) -> Parts:
    width, depth, leg = rng.uniform(0.9, 1.3), rng.uniform(0.9, 1.3), rng.uniform(0.8, 1.3)
    back, lean = rng.uniform(0.9, 1.5), rng.uniform(-15, 0)
    parts = [
        box(width, depth, 0.1),
        place(box(width, 0.08, back), (0, depth / 2 + back * np.sin(np.radians(-lean)) / 2, back / 2), (lean, 0, 0)),
        place(box(0.1, depth * 0.8, 0.08), (width / 2, 0, rng.uniform(0.3, 0.5))),  # one armrest only
        place(box(0.08, 0.08, 0.4), (width / 2, -depth * 0.3, 0.2)),
    ]
    for x in (-0.45, 0.45):
        for y in (-0.45, 0.45):
            parts.append(place(box(0.1, 0.1, leg), (x * width, y * depth, -leg / 2)))
    return parts


def _gear(rng: np.random.Generator) -> Parts:
    teeth, thick, depth = int(rng.integers(8, 20)), rng.uniform(0.3, 0.7), rng.uniform(0.12, 0.25)
    steps = np.arange(4 * teeth)
    radius = np.where(steps % 4 < 2, 1.0, 1.0 + depth)
    angles = steps * 2 * np.pi / len(steps)
    outline = np.stack([radius * np.cos(angles), radius * np.sin(angles)], axis=1)
    hub, crank = rng.uniform(0.25, 0.45), rng.uniform(0.5, 0.8)
    return [
        extrude(outline, thick),
        place(cylinder(hub, thick * 2), (0, 0, thick)),
        place(box(hub, hub * 0.5, thick * 1.6), (hub, 0, thick)),  # key
        place(box(rng.uniform(1.8, 2.6), 0.35, 0.15), (-1, 0, -thick / 2)),  # lever
        place(cylinder(rng.uniform(0.1, 0.2), rng.uniform(0.6, 1.2), 12), (0, crank, thick)),
    ]


def _hammer(rng: np.random.Generator) -> Parts:
    handle, head, radius = rng.uniform(2.2, 3.5), rng.uniform(0.9, 1.5), rng.uniform(0.2, 0.35)
    wedge = extrude(
        [(-0.1, -radius), (-0.1, radius), (head * 0.8, radius * 0.15), (head * 0.8, -radius * 0.15)], radius
    )
    grip = rng.uniform(0.6, 1.2)
    return [
        place(cylinder(radius * 0.45, handle, 16), (0, 0, -handle / 2)),
        place(cylinder(radius * 0.7, grip, 16), (0, 0, -handle + grip / 2)),
        place(cylinder(radius, head), (-head * 0.3, 0, 0), (0, 90, 0)),
        place(wedge, (head * 0.1, 0, 0)),
        place(torus(radius * 0.7, 0.06), (0, 0, -handle - radius * 0.5), (90, 0, 0)),
    ]


def _house(rng: np.random.Generator) -> Parts:
    width, depth, height = rng.uniform(1.8, 3), rng.uniform(1.5, 2.2), rng.uniform(1, 1.6)
    ridge, chimney, annex = rng.uniform(0.5, 1.1), rng.uniform(0.8, 1.6), rng.uniform(0.6, 1)
    roof = extrude([(-depth * 0.6, 0), (depth * 0.6, 0), (0, ridge)], width * 1.1)
    return [
        place(box(width, depth, height), (0, 0, height / 2)),
        place(roof, (0, 0, height), (90, 0, 90)),
        place(box(0.25, 0.25, chimney), (width * rng.uniform(0.2, 0.4), depth * 0.25, height + chimney / 2)),
        place(box(annex, depth * 0.7, height * 0.6), (-width / 2 - annex / 2, depth * 0.1, height * 0.3)),
        place(box(0.4, 0.1, 0.8), (width * 0.2, -depth / 2, 0.4)),
    ]


def _lamp(rng: np.random.Generator) -> Parts:
    base, lower, upper = rng.uniform(0.5, 0.9), rng.uniform(1.2, 2), rng.uniform(0.9, 1.6)
    lean, shade = rng.uniform(30, 75), rng.uniform(0.4, 0.7)
    direction = np.array([np.sin(np.radians(lean)), 0.0, np.cos(np.radians(lean))])
    elbow = np.array([0.0, 0.0, lower])
    return [
        cylinder(base, 0.15),
        place(box(0.25, 0.15, 0.15), (0, base * 0.7, 0.12)),  # switch
        place(cylinder(0.06, lower, 10), (0, 0, lower / 2)),
        place(sphere(0.14), elbow),
        place(cylinder(0.05, upper, 10), elbow + direction * upper / 2, (0, lean, 0)),
        place(cone(shade, shade * 0.4, shade * 1.2), elbow + direction * upper - (0, 0, shade * 0.5)),
    ]


def _mug(rng: np.random.Generator) -> Parts:
    radius, height, wall = rng.uniform(0.6, 0.9), rng.uniform(1.2, 2.2), rng.uniform(0.06, 0.12)
    top = radius * rng.uniform(0.9, 1.25)
    half = height / 2
    profile = [(0, -half), (radius, -half), (top, half), (top - wall, half), (radius - wall, -half + wall)]
    ring, tube = height * rng.uniform(0.28, 0.4), rng.uniform(0.12, 0.2)
    handle = place(torus(ring, tube, 180), turn_deg=(90, 0, -90))
    return [
        revolve([*profile, (0, -half + wall)]),
        place(handle, ((radius + top) / 2 - wall, 0, rng.uniform(-0.1, 0.1) * height)),
    ]


def _pipe(rng: np.random.Generator) -> Parts:
    radius, bend = rng.uniform(0.25, 0.4), rng.uniform(0.7, 1.2)
    first, second, flange = rng.uniform(1, 2.5), rng.uniform(0.4, 0.9), rng.uniform(1.5, 2)
    branch = rng.uniform(0.6, 1.1)
    return [
        torus(bend, radius, 90),
        place(cylinder(radius, first), (bend, -first / 2, 0), (90, 0, 0)),
        place(cylinder(radius, second), (-second / 2, bend, 0), (0, 90, 0)),
        place(cylinder(radius * flange, 0.2), (bend, -first, 0), (90, 0, 0)),
        place(cylinder(radius * 0.6, branch, 16), (bend, -first * rng.uniform(0.4, 0.7), branch / 2)),
        place(torus(radius * 1.1, 0.08), (-second, bend, 0), (0, 90, 0)),
    ]


def _stairs(rng: np.random.Generator) -> Parts:
    steps, width = int(rng.integers(4, 9)), rng.uniform(1.2, 2.4)
    run, rise = rng.uniform(0.3, 0.5), rng.uniform(0.2, 0.35)
    parts = [place(box(run, width, rise * (step + 1)), (run * step, 0, rise * (step + 1) / 2)) for step in range(steps)]
    for step in (0, steps - 1):  # a rail on one side only
        parts.append(place(cylinder(0.05, 1, 8), (run * step, width / 2, rise * (step + 1) + 0.5)))
    slope, length = np.degrees(np.arctan2(rise, run)), np.hypot(rise, run) * (steps - 1)
    middle = (run * (steps - 1) / 2, width / 2, rise * (steps + 1) / 2 + 1)
    return [*parts, place(box(length, 0.1, 0.1), middle, (0, -slope, 0))]


def _table(rng: np.random.Generator) -> Parts:
    width, depth, height = rng.uniform(1.5, 3), rng.uniform(0.9, 1.4), rng.uniform(0.9, 1.3)
    drawer, leg = rng.uniform(0.3, 0.6) * width, rng.uniform(0.08, 0.16)
    parts = [
        place(box(width, depth, 0.1), (0, 0, height)),
        place(box(drawer, depth * 0.8, 0.35), (width / 2 - drawer / 2 - leg, 0, height - 0.22)),
        place(cylinder(0.2, 0.4, 16), (-width * 0.3, depth * rng.uniform(0.1, 0.3), height + 0.25)),
        place(box(width * 0.3, 0.06, 0.06), (0, depth * 0.45, height * 0.3)),
    ]
    for x in (-0.47, 0.47):
        for y in (-0.45, 0.45):
            parts.append(place(cylinder(leg / 2, height, 8), (x * width, y * depth, height / 2)))
    return parts


CATEGORIES: dict[str, Callable[[np.random.Generator], Parts]] = {
    "aeroplane": _aeroplane,
    "bolt": _bolt,
    "bookshelf": _bookshelf,
    "bracket": _bracket,
    "car": _car,
    "chair": _chair,
    "gear": _gear,
    "hammer": _hammer,
    "house": _house,
    "lamp": _lamp,
    "mug": _mug,
    "pipe": _pipe,
    "stairs": _stairs,
    "table": _table,
}
