"""A scalar re-implementation of the model page, which takes its numbers from there and not from the package's data.

Its rigid body comes from the Lagrangian: kinetic and potential energy of four links written out, differentiated by
complex steps.
"""

import math

import numpy as np

UB = {
    "lengths": (0.0202, 0.0450, 0.0299, 0.0218),
    "masses": (5.0e-3, 10.1e-3, 6.0e-3, 3.8e-3),
    "transverse": (2.8e-7, 1.9e-6, 5.4e-7, 2.0e-7),
    "axial": (2.0e-7, 3.6e-7, 1.9e-7, 9.3e-8),
    "radii": {
        1: {1: 8.0e-3, 2: 8.0e-3},
        2: {1: -8.0e-3, 2: 8.0e-3},
        3: {3: 6.3e-3},
        4: {2: -5.3e-3, 3: -5.3e-3, 4: -5.3e-3},
    },
    "r35": 3.5e-3,
    "r45": 5.0e-3,
    "offset": (1.0, 1.0, 0.28, 0.51, 0.58),
    "rope": 5e4,
    "mass": 8.8e-6,
    "tendon": {"rho": 1.5, "s0": 5e4, "b": 1.0, "w": 0.01},
    "joint": {"kinetic": 2.5e-4, "static": 3.5e-4, "s0": 5.0, "b": 1e-3, "w": 0.1},
    "gain": (1.0, 1.0, 1.0, 1.0),
    "f0": 1.0,
}

_BOX = [
    (m, m * (0.016**2 / 12 + a**2 / 12), m * 0.016**2 / 6)
    for m, a in zip((8e-3, 20e-3, 10e-3, 6e-3), UB["lengths"], strict=True)
]

STICK_SLIP = UB | {
    "masses": tuple(box[0] for box in _BOX),
    "transverse": tuple(box[1] for box in _BOX),
    "axial": tuple(box[2] for box in _BOX),
    "radii": {
        1: {1: 5.0e-3, 2: 6.0e-3},
        2: {1: -5.0e-3, 2: 6.0e-3},
        3: {3: 5.0e-3},
        4: {2: -5.5e-3, 3: -4.5e-3, 4: -4.0e-3},
    },
    "r35": 4.5e-3,
    "r45": 4.5e-3,
    "offset": (1.0, 1.0, 1.2, 1.2, 2.0),
    "rope": 3e4,
    "mass": 1e-5,
    "tendon": {"rho": 1.3, "s0": 5e4, "b": 0.5, "w": 5e-3},
    "joint": {"kinetic": 3.0e-4, "static": 3.9e-4, "s0": 5.0, "b": 1e-5, "w": 0.05},
    "gain": (1.0, 1.0, 0.75, 0.5),
    "f0": 3.0,
}

NUMBERS = {"reversals": UB, "stick_slip": STICK_SLIP}


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def add(*vectors):
    return tuple(map(sum, zip(*vectors, strict=True)))


def scale(factor, vector):
    return tuple(factor * component for component in vector)


def chain(numbers, theta):
    """Return the joint axes, joint origins (tip last) and link directions; complex angles are allowed."""
    c1, s1 = np.cos(theta[0]), np.sin(theta[0])
    up, side = (0.0, 0.0, 1.0), (s1, -c1, 0.0)
    along, angle = [(c1, s1, 0.0)], 0.0
    for joint in (1, 2, 3):
        angle = angle + theta[joint]
        along.append((c1 * np.cos(angle), s1 * np.cos(angle), np.sin(angle)))
    origins = [(0.0, 0.0, 0.0)]
    for length, direction in zip(numbers["lengths"], along, strict=True):
        origins.append(add(origins[-1], scale(length, direction)))
    return [up, side, side, side], origins, along


def mass_matrix(numbers, theta):
    """Kinetic energy's coefficients: sum of m dc.dc + I_t w.w + (I_a - I_t)(w.u)(w.u) over the links."""
    axes, origins, along = chain(numbers, theta)
    matrix = np.zeros((4, 4), dtype=complex)
    for k in range(4):
        centre = add(origins[k], scale(0.5 * numbers["lengths"][k], along[k]))
        m, across, axial = numbers["masses"][k], numbers["transverse"][k], numbers["axial"][k]
        moves = [cross(axes[i], add(centre, scale(-1.0, origins[i]))) for i in range(k + 1)]
        for i in range(k + 1):
            for j in range(k + 1):
                spin = across * dot(axes[i], axes[j])
                spin = spin + (axial - across) * dot(axes[i], along[k]) * dot(axes[j], along[k])
                matrix[i, j] += m * dot(moves[i], moves[j]) + spin
    return matrix


def potential(numbers, theta):
    _, origins, along = chain(numbers, theta)
    height = [origins[k][2] + 0.5 * numbers["lengths"][k] * along[k][2] for k in range(4)]
    return 9.81 * sum(m * h for m, h in zip(numbers["masses"], height, strict=True))


def by_complex_step(function, theta):
    """Derivative with respect to each angle, exact to rounding."""
    steps = []
    for k in range(4):
        shifted = np.array(theta, dtype=complex)
        shifted[k] += 1e-30j
        steps.append(np.imag(function(shifted)) / 1e-30)
    return steps


def rigid_body(numbers, theta, velocity):
    """Return M and C theta' + G from Lagrange's equations."""
    mass = np.real(mass_matrix(numbers, theta))
    slopes = by_complex_step(lambda q: mass_matrix(numbers, q), theta)
    bias = by_complex_step(lambda q: potential(numbers, q), theta)
    for i in range(4):
        for j in range(4):
            for k in range(4):
                bias[i] += (slopes[k][i][j] - 0.5 * slopes[i][j][k]) * velocity[j] * velocity[k]
    return mass, np.array(bias)


def stribeck(kinetic, static, velocity, w):
    return kinetic + (static - kinetic) * math.exp(-abs(velocity) / w)


def scalar_model(numbers, x, command, force):
    """Return x' and the signals by name, from sections 1 to 6 of the model page."""
    theta, p5, velocity, p5_rate = x[0:4], x[4], x[5:9], x[9]
    tendon_stiction, joint_stiction = x[10:15], x[15:19]
    law = numbers["tendon"]
    a1, a2, a3 = (abs(angle) for angle in theta[:3])
    o = numbers["offset"]
    phi = [o[0] + a1, o[1] + a1, o[2] + a2, o[3] + a2 + a3, o[4]]
    slide = [sum(r * velocity[j - 1] for j, r in numbers["radii"][i].items()) for i in (1, 2, 3, 4)] + [p5_rate]
    loss = [s + law["b"] * v for s, v in zip(tendon_stiction, slide, strict=True)]
    f = [max(0.0, command[i] - loss[i]) for i in range(4)]
    half = 2.0 * numbers["rope"]
    f53 = max(0.0, half * (numbers["r35"] * theta[2] - p5))
    f54 = max(0.0, half * (p5 - numbers["r45"] * theta[3]))
    normal = [abs(f[i]) + abs(command[i]) for i in range(4)] + [f53 + f54]
    tendon_rate = []
    for i in range(5):
        mu = math.tanh(0.11 * phi[i] / 2.0)
        level = max(normal[i] * stribeck(mu, law["rho"] * mu, slide[i], law["w"]), 1e-4)
        tendon_rate.append(law["s0"] * (slide[i] - tendon_stiction[i] * abs(slide[i]) / level))
    torque = [0.0] * 4
    for i in (1, 2, 3, 4):
        for j, radius in numbers["radii"][i].items():
            torque[j - 1] += radius * f[i - 1]
    torque[2] -= numbers["r35"] * f53
    torque[3] += numbers["r45"] * f54

    axes, origins, along = chain(numbers, theta)
    sums = [sum(f), sum(f), f[2] + f[3] + f53, f[3] + f54]
    law = numbers["joint"]
    reaction, friction, joint_rate, limiter, external = [], [], [], [], []
    for j, e in enumerate([(1.0, 0.0, 0.0), *along[:3]]):
        reaction.append(math.sqrt(sum(component**2 for component in add(scale(-sums[j], e), force))))
        level = max(reaction[j] * stribeck(law["kinetic"], law["static"], velocity[j], law["w"]), 1e-7)
        friction.append(joint_stiction[j] + law["b"] * velocity[j])
        joint_rate.append(law["s0"] * (velocity[j] - joint_stiction[j] * abs(velocity[j]) / level))
        low, high = (-math.pi / 18, math.pi / 18) if j == 0 else (0.0, math.pi / 2)
        push = 0.0
        if theta[j] > high:
            push = max(0.0, 50.0 * (theta[j] - high) * (1.0 + 0.5 * velocity[j]))
        elif theta[j] < low:
            push = -max(0.0, 50.0 * (low - theta[j]) * (1.0 - 0.5 * velocity[j]))
        limiter.append(push)
        external.append(dot(cross(axes[j], add(origins[4], scale(-1.0, origins[j]))), force))
    mass, bias = rigid_body(numbers, theta, velocity)
    net = np.array(torque) - np.array(friction) - np.array(limiter) + np.array(external)
    acceleration = np.linalg.solve(mass, net - bias)
    p5_acceleration = (f53 - f54 - loss[4]) / numbers["mass"]
    rate = [*velocity, p5_rate, *acceleration, p5_acceleration, *tendon_rate, *joint_rate]
    signals = {"phi": phi, "slide": slide, "loss": loss, "strands": [*f, f53, f54], "normal": normal}
    signals |= {"torque": torque, "reaction": reaction, "friction": friction, "limiter": limiter, "external": external}
    return np.array(rate), signals


def controller(numbers, theta, desired):
    """(19), (21), (22): the shortest tensions that make the torque, plus internal tension up to the minimum."""
    table = np.zeros((5, 4))
    for i, crossings in numbers["radii"].items():
        for j, radius in crossings.items():
            table[i - 1, j - 1] = radius
    table[4, 2:] = -numbers["r35"], numbers["r45"]
    internal = np.empty(5)
    internal[3] = 1.0
    internal[4] = -table[3, 3] / table[4, 3]
    internal[2] = -(table[3, 2] + table[4, 2] * internal[4]) / table[2, 2]
    internal[0] = internal[1] = -table[3, 1] / (table[0, 1] + table[1, 1])
    torque = np.array(numbers["gain"]) * (desired - theta)
    minimal = table @ np.linalg.solve(table.T @ table, torque)
    return minimal + max((numbers["f0"] - m) / k for m, k in zip(minimal, internal, strict=True)) * internal


def random_states(numbers, count=100):
    """States with slack and taut tendons, inside and beyond the ranges, and commands and forces, some of them none."""
    draw = np.random.default_rng(14)
    for index in range(count):
        theta = np.append(draw.uniform(-0.25, 0.25), draw.uniform(-0.1, 1.7, 3))
        velocity = draw.normal(0.0, 3.0, 4) * (index % 10 != 0)
        if index % 2:
            theta[3] = (numbers["r35"] * theta[2] - draw.normal(2.0, 4.0) / numbers["rope"]) / numbers["r45"]
        p5 = 0.5 * (numbers["r35"] * theta[2] + numbers["r45"] * theta[3]) + draw.normal(0.0, 3e-5)
        stictions = draw.normal(0.0, 0.5, 5), draw.normal(0.0, 2e-3, 4)
        x = np.concatenate([theta, [p5], velocity, [draw.normal(0.0, 0.05)], *stictions])
        command = draw.uniform(0.0, 5.0, 4) * (draw.uniform(size=4) > 0.1)
        force = draw.normal(0.0, 1.0, 3) * (index % 3 != 0)
        yield x, command, force
