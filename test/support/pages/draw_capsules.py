"""The picture of the guard's capsules in docs/motion_guard.md: each model in a usual pose, from the front and the side.

Behind the models stands which pairs of parts are looked at, for each set of pairs that a model has. Seen from far away,
a capsule is a line with round ends, as wide as twice its radius: SVG draws exactly that. After a change of the shapes,
drawn anew by

    build/venv/bin/python3 test/support/pages/draw_capsules.py
"""
import math
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from jaka_ros_driver.clearance.shape import arm_shape  # noqa: E402
from jaka_ros_driver.kinematics.arm_models import SPHERICAL_WRIST, TWO_PARALLEL, load_model, model_names  # noqa: E402
from jaka_ros_driver.kinematics.forward import link_transforms  # noqa: E402

PICTURE = ROOT / "docs" / "pictures" / "motion_guard_capsules.svg"
COLUMNS = 6
CELL, GAP = 300, 30
"""Width and height of a model's cell, and the space around what is in it, in units of the picture."""
COLOURS = ("#4a4a4a", "#31688e", "#35b779", "#7ad151", "#b5a91d", "#e08214", "#b2182b", "#762a83")
USUAL = (0.0, 0.5 * math.pi, -0.5 * math.pi, 0.5 * math.pi, 0.5 * math.pi, 0.0)
POSES = {SPHERICAL_WRIST: (0.0, 0.3, -1.9, 0.0, -1.2, 0.0),
         TWO_PARALLEL: (0.0, 0.5 * math.pi, -0.5 * math.pi, 0.0, 0.5 * math.pi, 0.0)}
ROW = 21
"""Height of a row of the pairs."""
VIEWS = ((0, 2, 1, "side"), (1, 2, 0, "front"))
"""Axes of the base that run right, up and towards the one who looks, and the name of the view."""


def usual_pose(model):
    """Return the joint angles, rad, in which a model is drawn: upper arm up, forearm forward, flange down."""
    return POSES.get(model.family, USUAL)


def placed_capsules(model):
    """Return (capsule, start, end), the ends in the base frame, m."""
    frames = link_transforms(model, usual_pose(model))

    def place(frame, point):
        return tuple(sum(frame[3 * row + n] * point[n] for n in range(3)) + frame[9 + row] for row in range(3))
    return [(capsule, place(frames[capsule.frame], capsule.start), place(frames[capsule.frame], capsule.end))
            for capsule in arm_shape(model).capsules]


def drawn(name, left, top):
    """Return the lines of one model's cell."""
    model = load_model(name)
    capsules = placed_capsules(model)
    lines = ['<text x="%d" y="%d">%s</text>' % (left + GAP, top + 20, name)]
    extent = max(max(abs(value) for value in start + end) + capsule.radius for capsule, start, end in capsules)
    scale = (CELL - 2 * GAP) / (1.5 * extent)
    for number, (right, up, depth, view) in enumerate(VIEWS):
        x0, y0 = left + CELL * (0.14 + 0.58 * number), top + CELL - GAP
        sign = -1.0 if view == "side" else 1.0  # from -y, where x runs right; from +x, where y runs right
        lines.append('<line class="floor" x1="%.1f" y1="%.1f" x2="%.1f" y2="%.1f"/>' % (
            x0 - 40, y0, x0 + 40, y0))
        order = sorted(range(len(capsules)), key=lambda n: sign * (capsules[n][1][depth] + capsules[n][2][depth]))
        for n in order:
            capsule, start, end = capsules[n]
            lines.append('<line x1="%.1f" y1="%.1f" x2="%.2f" y2="%.1f" stroke="%s" stroke-width="%.1f"/>' % (
                x0 + scale * start[right], y0 - scale * start[up], x0 + scale * end[right] + 0.01,
                y0 - scale * end[up], COLOURS[capsule.frame], 2.0 * scale * capsule.radius))
    return lines


def sets_of_pairs():
    """Return each set of pairs that a model has, as {(names of the parts, colours, pairs): models}."""
    sets = {}
    for name in model_names():
        shape = arm_shape(load_model(name))
        key = (tuple(capsule.name for capsule in shape.capsules),
               tuple(COLOURS[capsule.frame] for capsule in shape.capsules), shape.pairs)
        sets.setdefault(key, []).append(name)
    return sets


def drawn_pairs(parts, models, left, top):
    """Return the lines of a table of pairs: a row and a column for each part, a dot where the two are looked at."""
    names, colours, pairs = parts
    title = ", ".join(models) if len(models) < 3 else "%d models" % len(models)
    lines = ['<text x="%d" y="%d">%s: %d pairs</text>' % (left, top, title, len(pairs))]
    for row, (name, colour) in enumerate(zip(names, colours), 1):
        y = top + ROW * row
        lines.append('<line x1="%d" y1="%d" x2="%d" y2="%d" stroke="%s" stroke-width="12"/>' % (
            left + 8, y, left + 20, y, colour))
        lines.append('<text x="%d" y="%d">%s</text>' % (left + 34, y + 5, name))
        lines += ['<circle cx="%d" cy="%d" r="5" fill="%s"/>' % (left + 190 + 20 * first, y, colours[first])
                  for first, second in pairs if second == row - 1]
    return lines


def picture():
    """Return the SVG of all models."""
    names = model_names()
    rows = -(-len(names) // COLUMNS)
    lines = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 %d %d" font-family="sans-serif" font-size="16" '
             'stroke-linecap="round">' % (COLUMNS * CELL, rows * CELL),
             '<style>.floor { stroke: #999; stroke-width: 2 }</style>',
             '<rect width="100%" height="100%" fill="white"/>']
    for n, name in enumerate(names):
        lines += drawn(name, n % COLUMNS * CELL, n // COLUMNS * CELL)
    left, top = len(names) % COLUMNS * CELL, (rows - 1) * CELL + 20
    for parts, models in sorted(sets_of_pairs().items(), key=lambda item: -len(item[1])):
        if top + ROW * len(parts[0]) > rows * CELL:
            left, top = left + 310, (rows - 1) * CELL + 20
        lines += drawn_pairs(parts, models, left, top)
        top += ROW * (len(parts[0]) + 1) + 10
    return "\n".join(lines + ["</svg>"]) + "\n"


def draw() -> None:
    """Write the picture."""
    PICTURE.write_text(picture(), encoding="utf-8")


if __name__ == "__main__":
    draw()
