"""The forces of tables of rows without a mechanism: each law is given its rows' arguments."""

from types import SimpleNamespace

import numpy as np

from finger_pin.laws.law import Row


def exert(tables, q, v, states, command, earlier=None):
    """Return force, rate, arguments and signals of every table, by group; ``earlier`` are given forces."""
    forces, found = dict(earlier or {}), {}
    for table in tables:
        none = np.zeros((*q.shape[:-1], len(table.names)))
        row = Row(
            length=q @ table.measure.T + table.offset,
            speed=v @ table.arm.T,
            state=states.get(table.group, none),
            load=np.abs(sum((forces[group] @ weights.T for group, weights in table.loads.items()), none)),
            command=command[..., table.channels] if np.any(table.channels >= 0) else none,
            curvature=np.abs(q) @ table.bends.T + table.curvature_offset,
        )
        force, rate, *signals = table.law.value(row, table.parameters)
        named = dict(zip(table.law.signals, signals, strict=True))
        found[table.group] = SimpleNamespace(force=force, rate=rate, **row._asdict(), **named)
        forces[table.group] = force
    return found


def tendon_forces(layer, position, velocity, passive_position, passive_velocity, stiction, command):
    """Return the signals of a tendon layer, by the names of the paper; driven tendons first, then passive ones."""
    actuated = layer.routing.actuated
    q, v = (np.concatenate(pair, axis=-1) for pair in ((position, passive_position), (velocity, passive_velocity)))
    states = {"driven_tendons": stiction[..., :actuated], "passive_tendons": stiction[..., actuated:]}
    tables = layer.rows()
    found = exert(tables, q, v, states, command)
    halves, driven, passive = (found[name] for name in ("passive_halves", "driven_tendons", "passive_tendons"))
    torque = sum(found[table.group].force @ table.arm for table in tables)

    def both(name):
        return np.concatenate([getattr(driven, name), getattr(passive, name)], axis=-1)

    return SimpleNamespace(
        curvature=both("curvature"),
        coefficient=both("coefficient"),
        velocity=both("speed"),
        friction=both("friction"),
        normal=both("normal_force"),
        level=both("level"),
        stiction_rate=both("rate"),
        strands=np.concatenate([driven.force, halves.force], axis=-1),
        passive_acceleration=torque[..., position.shape[-1] :] / layer.mass,
    )


def pin_forces(joints, velocity, stiction, strands, actuated=4):
    """Return the friction of joints under tensions of the strands, without forces at the tip."""
    earlier = {"driven_tendons": strands[..., :actuated], "passive_halves": strands[..., actuated:]}
    table = joints.rows({}, velocity.shape[-1], {})
    still, states = np.zeros_like(velocity), {table.group: stiction}
    return exert([table], still, velocity, states, np.zeros(0), earlier)[table.group]
