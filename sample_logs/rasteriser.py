"""Finds for every sample of an image buffer which triangle is seen there: a visibility buffer.

Edge functions and perspective-correct interpolation as in Pineda, "A parallel algorithm for polygon rasterization"
(1988) and Blinn, "Hyperbolic interpolation" (1992); the buffer of triangle numbers as in Burns and Hunt, "The
visibility buffer" (2013). Sample (row, column) lies at x = column + 0.5, y = row + 0.5 of the buffer.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from scpf.sample_logs.kernels import cross, dot, kernel, minus, part, transformed

LEAF_ALPHA = 110
"""A texel of a leaf card above this is leaf."""
CARD_LEVELS = 6


class Corner(NamedTuple):
    """A corner of a triangle on the buffer."""

    x: Any
    y: Any
    nearness: Any
    inverse_depth: Any
    """1 in orthographic views."""
    u: Any
    v: Any


@part
def _edge(p: Any, q: Any, sign: Any) -> Any:
    """The edge p to q as where it crosses a row, x = start + slope * y, and on which side of that the inside is:
    1 to the right, -1 to the left, 0 for a level edge, which cuts off whole rows: start * y + slope < 0."""
    a = (p.y - q.y) * sign
    b = (q.x - p.x) * sign
    c = -(a * p.x + b * p.y)
    if a == 0.0:
        return b, c, 0.0
    return -c / a, -b / a, 1.0 if a > 0 else -1.0


@part
def _inside(edge: Any, y: Any, low: Any, high: Any) -> Any:
    """The stretch low to high of a row, cut down to the inner side of an edge."""
    start, slope, side = edge
    if side > 0.0:
        low = max(low, start + slope * y)
    elif side < 0.0:
        high = min(high, start + slope * y)
    elif start * y + slope < 0.0:
        high = low - 1.0
    return low, high


@part
def _slopes(a: Any, b: Any, c: Any, at_a: Any, at_b: Any, at_c: Any, inverse_area: Any) -> Any:
    """Change per sample to the right and per row of a value that is linear over the triangle."""
    to_b, to_c = at_b - at_a, at_c - at_a
    right = (to_b * (c.y - a.y) - to_c * (b.y - a.y)) * inverse_area
    down = (to_c * (b.x - a.x) - to_b * (c.x - a.x)) * inverse_area
    return right, down


@part
def _card_level(a: Any, b: Any, c: Any, area: Any, size: Any) -> Any:
    """The mip level at which a texel covers about one sample."""
    texels = abs((b.u - a.u) * (c.v - a.v) - (c.u - a.u) * (b.v - a.v)) * size * size
    density, level = texels / abs(area), 0
    while density > 2.0 and level < CARD_LEVELS - 1:
        density *= 0.25
        level += 1
    return level


@part
def _fill(buffer: Any, a: Any, b: Any, c: Any, number: Any, cards: Any, card: Any) -> None:
    """Enter one triangle where it is nearer than what is there; ``card`` -1 for an opaque one."""
    rows, columns = buffer.nearness.shape
    area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y)
    if area == 0.0 or not abs(area) < 1e18:
        return
    left, right = min(a.x, min(b.x, c.x)), max(a.x, max(b.x, c.x))
    top, bottom = min(a.y, min(b.y, c.y)), max(a.y, max(b.y, c.y))
    if right < 0 or bottom < 0 or left > columns or top > rows:
        return
    sign = 1.0 if area > 0 else -1.0
    edge_ab, edge_bc, edge_ca = _edge(a, b, sign), _edge(b, c, sign), _edge(c, a, sign)
    inverse_area = 1.0 / area
    near_x, near_y = _slopes(a, b, c, a.nearness, b.nearness, c.nearness, inverse_area)
    has_holes, offset, size = card >= 0, 0, 1
    w_x = w_y = u_x = u_y = v_x = v_y = 0.0
    if has_holes:
        level = _card_level(a, b, c, area, cards.size)
        offset, size = cards.offset[card, level], cards.size >> level
        wa, wb, wc = a.inverse_depth, b.inverse_depth, c.inverse_depth
        w_x, w_y = _slopes(a, b, c, wa, wb, wc, inverse_area)
        u_x, u_y = _slopes(a, b, c, a.u * wa, b.u * wb, c.u * wc, inverse_area)
        v_x, v_y = _slopes(a, b, c, a.v * wa, b.v * wb, c.v * wc, inverse_area)
    for row in range(max(0, math.ceil(top - 0.5)), min(rows - 1, math.floor(bottom - 0.5)) + 1):
        y = row + 0.5
        low, high = _inside(edge_ab, y, left, right)
        low, high = _inside(edge_bc, y, low, high)
        low, high = _inside(edge_ca, y, low, high)
        if high < low:
            continue
        first, last = max(0, math.ceil(low - 0.5)), min(columns - 1, math.floor(high - 0.5))
        dx, dy = first + 0.5 - a.x, y - a.y
        nearness = a.nearness + dx * near_x + dy * near_y
        if not has_holes:
            for column in range(first, last + 1):
                if nearness > buffer.nearness[row, column]:
                    buffer.nearness[row, column] = nearness
                    buffer.face[row, column] = number
                nearness += near_x
            continue
        w = a.inverse_depth + dx * w_x + dy * w_y
        u = a.u * a.inverse_depth + dx * u_x + dy * u_y
        v = a.v * a.inverse_depth + dx * v_x + dy * v_y
        for column in range(first, last + 1):
            if nearness > buffer.nearness[row, column]:
                texels = size / w
                i, j = min(max(int(u * texels), 0), size - 1), min(max(int(v * texels), 0), size - 1)
                if cards.alpha[offset + j * size + i] > LEAF_ALPHA:
                    buffer.nearness[row, column] = nearness
                    buffer.face[row, column] = number
            nearness += near_x
            w += w_x
            u += u_x
            v += v_x


@part
def _corner(view: Any, p: Any, u: Any, v: Any) -> Any:
    """Where a point of the view's frame falls on the buffer."""
    if view.is_orthographic:
        return Corner(p[0], p[1], p[2], 1.0, u, v)
    w = 1.0 / p[2]
    return Corner(view.focal * p[0] * w + view.centre_x, view.focal * p[1] * w + view.centre_y, w, w, u, v)


@part
def _fill_clipped(
    buffer: Any, view: Any, p: Any, q: Any, r: Any, number: Any, cards: Any, polygon: Any
) -> None:
    """Fill what lies beyond the near plane of an opaque triangle that crosses it (Sutherland-Hodgman)."""
    count = 0
    for start, end in ((p, q), (q, r), (r, p)):
        if start[2] >= view.near_m:
            for k in range(3):
                polygon[count, k] = start[k]
            count += 1
        if (start[2] >= view.near_m) != (end[2] >= view.near_m):
            t = (view.near_m - start[2]) / (end[2] - start[2])
            for k in range(3):
                polygon[count, k] = start[k] + t * (end[k] - start[k])
            count += 1
    first = _corner(view, (polygon[0, 0], polygon[0, 1], polygon[0, 2]), 0.0, 0.0)
    for k in range(1, count - 1):
        second = _corner(view, (polygon[k, 0], polygon[k, 1], polygon[k, 2]), 0.0, 0.0)
        third = _corner(view, (polygon[k + 1, 0], polygon[k + 1, 1], polygon[k + 1, 2]), 0.0, 0.0)
        _fill(buffer, first, second, third, number, cards, -1)


@kernel
def draw(
    buffer: Any,
    view: Any,
    meshes: Any,
    cards: Any,
    prototypes: Any,
    T_view_local: Any,
    first_number: Any,
    scratch: Any,
) -> None:
    """Draw instances: ``prototypes`` (n,), ``T_view_local`` (n, 3, 4), and the number of their first faces (n,).

    In perspective, faces nearer than ``view.near_m`` are cut there, leaf cards left out; a prototype that says so
    loses the faces that look away.
    """
    points = scratch.points
    for k in range(prototypes.size):
        prototype, T = prototypes[k], T_view_local[k]
        start = meshes.first_vertex[prototype]
        for i in range(meshes.vertex_count[prototype]):
            x, y = meshes.vertices[start + i, 0], meshes.vertices[start + i, 1]
            z = meshes.vertices[start + i, 2]
            points[i, 0], points[i, 1], points[i, 2] = transformed(T, x, y, z)
        card, culls = meshes.alpha_card[prototype], meshes.cull_backfaces[prototype]
        for i in range(meshes.face_count[prototype]):
            face = meshes.first_face[prototype] + i
            j0, j1, j2 = meshes.faces[face, 0], meshes.faces[face, 1], meshes.faces[face, 2]
            p = (points[j0, 0], points[j0, 1], points[j0, 2])
            q = (points[j1, 0], points[j1, 1], points[j1, 2])
            r = (points[j2, 0], points[j2, 1], points[j2, 2])
            if not view.is_orthographic:
                if max(p[2], max(q[2], r[2])) < view.near_m:
                    continue
                if culls and dot(cross(minus(q, p), minus(r, p)), p) >= 0:
                    continue
                if min(p[2], min(q[2], r[2])) < view.near_m:
                    if card < 0:
                        _fill_clipped(buffer, view, p, q, r, first_number[k] + i, cards, scratch.polygon)
                    continue
            a = _corner(view, p, meshes.uv[face, 0, 0], meshes.uv[face, 0, 1])
            b = _corner(view, q, meshes.uv[face, 1, 0], meshes.uv[face, 1, 1])
            c = _corner(view, r, meshes.uv[face, 2, 0], meshes.uv[face, 2, 1])
            _fill(buffer, a, b, c, first_number[k] + i, cards, card)
