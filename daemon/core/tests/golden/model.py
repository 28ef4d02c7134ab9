#!/usr/bin/env python3
"""Golden values of the model of Wahrburg & Listmann (CDC 2016), eq. (17), for the paper's planar arm in contact.

    python3 model.py            write model.json beside this script
    python3 model.py --check    exit 1 unless model.json is exactly what this script writes

Needs nothing but Python 3.9 or later: 60-digit decimal arithmetic from the standard library.

Independent of the Rust code: every entry is a scalar expression derived by hand for this arm. There is no matrix
product, no inversion and no loop over a chain of joints.

    arm       l1 = l2 = 1 m, tool centre point p = (x, y), joint axes along +z:
              x = l1 c1 + l2 c12,  y = l1 s1 + l2 s12      c1 = cos q1, s12 = sin(q1 + q2), ...
    J         [[-l1 s1 - l2 s12, -l2 s12], [l1 c1 + l2 c12, l2 c12]],  det J = l1 l2 sin q2
    surface   unit normal n = (sin a, cos a), a = 25 degrees: the surface falls to the right, as in figure 5. With (19),
              (21) this is K_e = T_plane^T K_e,plane T_plane = k n n^T.
    contact   point c = (1.32, 0.68) m; p = c - depth n, so that K_e (p - c) = -k depth n
    f_lin     = f_offset + F q,  F = K_e J,  f_offset = K_e (p - c - J q)                                         (16)
    state     [q1 q2 qd1 qd2 f...], forward Euler over T_s                                                        (17)

With only y active (III.C) the state of the wrench is f_y alone and the input is dp_y alone: B is the y column of
J^-1, E keeps both columns because the commanded velocity has both, and f_y keeps its dependence on both components of
the position, which K_e couples.
"""

import json
import math
import pathlib
import sys
from decimal import Decimal, getcontext

getcontext().prec = 60
D = Decimal
PI = D("3.1415926535897932384626433832795028841971693993751058209749445923078164")

STIFFNESS, TILT_DEGREES, DEPTH = 1e5, 25.0, 1e-3
CONTACT = (1.32, 0.68)
LINKS = (1.0, 1.0)
JOINT_LAGS, WRENCH_LAGS = (0.015, 0.010), (0.020, 0.020)
SAMPLING_TIME = 0.004


def sine(angle):
    """Taylor series: the angles here are below 4 rad."""
    total, term, order = D(0), angle, 1
    while abs(term) > D("1e-65"):
        total += term
        term *= -angle * angle / ((order + 1) * (order + 2))
        order += 2
    return total


def cosine(angle):
    return sine(angle + PI / 2)


def configuration():
    """The floats nearest to the joint position with elbow q2 < 0 that puts p at c - depth n."""
    tilt = D(TILT_DEGREES) * PI / 180
    x = D(CONTACT[0]) - D(DEPTH) * sine(tilt)
    y = D(CONTACT[1]) - D(DEPTH) * cosine(tilt)
    l1, l2 = D(LINKS[0]), D(LINKS[1])
    c2 = (x * x + y * y - l1 * l1 - l2 * l2) / (2 * l1 * l2)
    s2 = -(1 - c2 * c2).sqrt()
    # p = (l1 + l2 c2) (c1, s1) + l2 s2 (-s1, c1), solved for c1 and s1.
    r2 = x * x + y * y
    c1 = ((l1 + l2 * c2) * x + l2 * s2 * y) / r2
    s1 = ((l1 + l2 * c2) * y - l2 * s2 * x) / r2
    result = []
    for s, c in ((s1, c1), (s2, c2)):
        angle = D(math.atan2(float(s), float(c)))
        for _ in range(4):
            angle += s * cosine(angle) - c * sine(angle)
        result.append(float(angle))
    return result


def golden():
    q = configuration()
    q1, q2 = D(q[0]), D(q[1])
    l1, l2 = D(LINKS[0]), D(LINKS[1])
    s1, c1, s12, c12, s2 = sine(q1), cosine(q1), sine(q1 + q2), cosine(q1 + q2), sine(q2)
    tilt = D(TILT_DEGREES) * PI / 180
    nx, ny = sine(tilt), cosine(tilt)
    k, ts = D(STIFFNESS), D(SAMPLING_TIME)
    tv1, tv2 = D(JOINT_LAGS[0]), D(JOINT_LAGS[1])
    tex, tey = D(WRENCH_LAGS[0]), D(WRENCH_LAGS[1])

    px, py = l1 * c1 + l2 * c12, l1 * s1 + l2 * s12
    dx, dy = px - D(CONTACT[0]), py - D(CONTACT[1])

    # J, and its inverse by the rule for 2x2.
    jx1, jx2 = -l1 * s1 - l2 * s12, -l2 * s12
    jy1, jy2 = l1 * c1 + l2 * c12, l2 * c12
    det = l1 * l2 * s2
    i1x, i1y = l2 * c12 / det, l2 * s12 / det
    i2x, i2y = -(l1 * c1 + l2 * c12) / det, -(l1 * s1 + l2 * s12) / det

    # K_e = k n n^T, F = K_e J: along q_i the normal moves by nx jxi + ny jyi.
    normal1, normal2 = nx * jx1 + ny * jy1, nx * jx2 + ny * jy2
    fx1, fx2 = k * nx * normal1, k * nx * normal2
    fy1, fy2 = k * ny * normal1, k * ny * normal2
    depth = nx * dx + ny * dy
    forcex, forcey = k * nx * depth, k * ny * depth
    offsetx, offsety = forcex - fx1 * q1 - fx2 * q2, forcey - fy1 * q1 - fy2 * q2

    a1, a2 = 1 - ts / tv1, 1 - ts / tv2
    b1x, b1y, b2x, b2y = ts / tv1 * i1x, ts / tv1 * i1y, ts / tv2 * i2x, ts / tv2 * i2y
    wx, wy = ts / tex, ts / tey

    both = {
        "active_axes": ["x", "y"],
        "state": ["q1", "q2", "qd1", "qd2", "fx", "fy"],
        "A": [
            [1, 0, ts, 0, 0, 0],
            [0, 1, 0, ts, 0, 0],
            [0, 0, a1, 0, 0, 0],
            [0, 0, 0, a2, 0, 0],
            [wx * fx1, wx * fx2, 0, 0, 1 - wx, 0],
            [wy * fy1, wy * fy2, 0, 0, 0, 1 - wy],
        ],
        "B": [[0, 0], [0, 0], [b1x, b1y], [b2x, b2y], [0, 0], [0, 0]],
        "E": [[0, 0], [0, 0], [b1x, b1y], [b2x, b2y], [0, 0], [0, 0]],
        "gamma": [0, 0, 0, 0, wx * offsetx, wy * offsety],
        "force_offset": [offsetx, offsety],
        "force_by_joint": [[fx1, fx2], [fy1, fy2]],
        "force_here": [forcex, forcey],
    }
    only_y = {
        "active_axes": ["y"],
        "state": ["q1", "q2", "qd1", "qd2", "fy"],
        "A": [
            [1, 0, ts, 0, 0],
            [0, 1, 0, ts, 0],
            [0, 0, a1, 0, 0],
            [0, 0, 0, a2, 0],
            [wy * fy1, wy * fy2, 0, 0, 1 - wy],
        ],
        "B": [[0], [0], [b1y], [b2y], [0]],
        "E": [[0, 0], [0, 0], [b1x, b1y], [b2x, b2y], [0, 0]],
        "gamma": [0, 0, 0, 0, wy * offsety],
        "force_offset": [offsety],
        "force_by_joint": [[fy1, fy2]],
        "force_here": [forcey],
    }
    return {
        "generated_by": "model.py",
        "links_m": list(LINKS),
        "contact_point_m": list(CONTACT),
        "depth_m": DEPTH,
        "surface_tilt_deg": TILT_DEGREES,
        "surface_normal": [nx, ny],
        "normal_stiffness_n_per_m": STIFFNESS,
        "stiffness_n_per_m": [[k * nx * nx, k * nx * ny], [k * nx * ny, k * ny * ny]],
        "joint_time_constants_s": list(JOINT_LAGS),
        "wrench_time_constants_s": list(WRENCH_LAGS),
        "sampling_time_s": SAMPLING_TIME,
        "joint_position": q,
        "tcp_position_m": [px, py],
        "tcp_minus_contact_m": [dx, dy],
        "jacobian": [[jx1, jx2], [jy1, jy2]],
        "inverse_jacobian": [[i1x, i1y], [i2x, i2y]],
        "models": [both, only_y],
    }


def pretty(value, indent=0):
    """JSON with one line per array of numbers, so that a change can be read in a diff."""
    pad = " " * (indent + 1)
    if isinstance(value, dict):
        items = [f"{pad}{json.dumps(key)}: {pretty(item, indent + 1)}" for key, item in value.items()]
        return "{\n" + ",\n".join(items) + "\n" + pad[1:] + "}"
    if isinstance(value, list) and any(isinstance(item, (list, dict)) for item in value):
        return "[\n" + ",\n".join(pad + pretty(item, indent + 1) for item in value) + "\n" + pad[1:] + "]"
    return json.dumps(value, default=float)


def main(arguments):
    target = pathlib.Path(__file__).with_suffix(".json")
    if arguments not in ([], ["--check"]):
        print(__doc__, file=sys.stderr)
        return 64
    text = pretty(golden()) + "\n"
    if not arguments:
        target.write_bytes(text.encode())
        return 0
    if not target.exists() or target.read_bytes() != text.encode():
        print(f"{target} is not what {pathlib.Path(__file__).name} computes: regenerate it", file=sys.stderr)
        return 1
    print(f"{target.name}: as computed")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
