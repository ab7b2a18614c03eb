"""Which attributes of MuJoCo's XML schema are carried over, listed as left out, or of no effect on motion."""

from __future__ import annotations

from typing import Literal

Kind = Literal["carried", "listed", "idle"]
#: All attributes of an element.
ALL = "*"
# Names, groups, colours and classes, of any element.
_NO_EFFECT = "name class childclass group user rgba material"
_POSE = "pos quat axisangle euler xyaxes zaxis"
_TRANSMISSION = "armature damping delay gear joint jointinparent refsite site tendon"
# What drives something else is listed as a whole.
_ELSEWHERE = "slidersite cranksite cranklength"
_DRIVEN = {
    "carried": f"{_TRANSMISSION} ctrllimited ctrlrange forcelimited forcerange",
    "listed": _ELSEWHERE,
    # How MuJoCo keeps late controls; of muscles, for which lengths are found, they are resolved by MuJoCo's compiler.
    "idle": "interp nsample lengthrange",
}
_SOFT = "limited range margin solreflimit solimplimit"
_LIMITED = "actuatorfrclimited actuatorfrcrange"
_STRAINED = "armature springyield solreffriction"


def _actuator(carried: str = "", listed: str = "", idle: str = "") -> dict[Kind, str]:
    return {
        "carried": f"{_DRIVEN['carried']} {carried}",
        "listed": f"{_DRIVEN['listed']} {listed}",
        "idle": f"{_DRIVEN['idle']} {idle}",
    }


_TENDON: dict[Kind, str] = {
    "carried": f"{_SOFT} {_LIMITED} damping stiffness frictionloss springlength",
    "listed": _STRAINED,
    "idle": "width solimpfriction",
}
_EQUALITY: dict[Kind, str] = {"carried": "active solref solimp"}

#: By element, below its parent where another has the same name, attributes by kind; children without entry are as it.
#: Where one number of a carried or listed attribute alone is left out, the list says so: polynomials of stiffness and
#: damping, forces on what several drive.
SCHEMA: dict[str, dict[Kind, str]] = {
    "mujoco": {"idle": "model"},
    # MuJoCo's compiler has resolved them.
    "compiler": {"carried": ALL},
    "extension": {"listed": ALL},
    "option": {
        "carried": "cone gravity impratio o_friction actuatorgroupdisable timestep",
        "listed": "density viscosity wind o_margin o_solref o_solimp",
        "idle": "ccd_iterations ccd_tolerance integrator iterations jacobian ls_iterations ls_tolerance "
        "magnetic noslip_iterations noslip_tolerance sdf_initpoints sdf_iterations sleep_tolerance solver tolerance",
    },
    "flag": {
        "carried": "actuation clampctrl constraint contact damper equality filterparent frictionloss gravity limit "
        "override spring refsafe",
        "listed": "autoreset diagexact energy eulerdamp fwdinv invdiscrete ipc island midphase multiccd nativeccd "
        "sensor sleep speculative warmstart",
    },
    "size": {"idle": ALL},
    "statistic": {"idle": ALL},
    "visual": {"idle": ALL},
    "asset/mesh": {"carried": ALL},
    "asset/hfield": {"listed": ALL},
    "asset/model": {"carried": ALL},
    "asset": {"idle": ALL},
    "deformable/skin": {"idle": ALL},
    "deformable": {"listed": ALL},
    "body": {"carried": f"{_POSE} gravcomp fuse mocap simple", "idle": "sleep"},
    "inertial": {"carried": f"{_POSE} mass diaginertia fullinertia"},
    "joint": {
        "carried": f"{_SOFT} {_LIMITED} armature axis damping frictionloss pos ref springdamper "
        "springref stiffness type",
        "listed": "actuatorgravcomp springyield solreffriction",
        "idle": "solimpfriction",
    },
    "freejoint": {"carried": "align"},
    "body/geom": {
        "carried": f"{_POSE} conaffinity contype condim density fitscale friction fromto mass mesh priority "
        "shellinertia size solimp solmix solref type",
        "listed": "adhesion fluidcoef fluidshape gap hfield margin surfacevel",
        "idle": "castshadow",
    },
    "body/site": {"carried": f"{_POSE} fromto", "idle": "mesh size type"},
    "attach": {"carried": ALL},
    "camera": {"idle": ALL},
    "light": {"idle": ALL},
    "body/plugin": {"listed": ALL},
    "geom/plugin": {"listed": ALL},
    "flexcomp": {"listed": ALL},
    "pair": {"carried": "condim friction geom1 geom2 solimp solref", "listed": "adhesion gap margin solreffriction"},
    "exclude": {"carried": "body1 body2"},
    "spatial": _TENDON,
    "fixed": _TENDON,
    "spatial/site": {"carried": "site"},
    "spatial/geom": {"carried": "geom sidesite"},
    "pulley": {"carried": "divisor"},
    "fixed/joint": {"carried": "joint coef"},
    "connect": _EQUALITY | {"carried": f"{_EQUALITY['carried']} anchor body1 body2 site1 site2"},
    "weld": _EQUALITY | {"carried": f"{_EQUALITY['carried']} anchor body1 body2 site1 site2 relpose torquescale"},
    "equality/joint": _EQUALITY | {"carried": f"{_EQUALITY['carried']} joint1 joint2 polycoef"},
    "equality/tendon": _EQUALITY | {"carried": f"{_EQUALITY['carried']} tendon1 tendon2 polycoef"},
    "equality/flex": {"listed": ALL},
    "flexstrain": {"listed": ALL},
    "general": _actuator(
        "actlimited actrange biasprm biastype dynprm dyntype gainprm gaintype inheritrange",
        "actdim body input",
        "actearly ffrange velrange",
    ),
    "motor": _actuator(),
    "position": _actuator("dampratio inheritrange kp kv timeconst"),
    "actuator/velocity": _actuator("kv"),
    "intvelocity": _actuator("actlimited actrange dampratio inheritrange kp kv"),
    "orientation": {"listed": ALL},
    "pid": _actuator("dampratio imax inheritrange ki kp kv slewmax", "input", "ffrange posrange velrange"),
    "damper": {"listed": ALL},
    "cylinder": _actuator("area bias diameter timeconst"),
    "muscle": _actuator("force fpmax fvmax lmax lmin range scale tausmooth timeconst vmax"),
    "adhesion": {"listed": ALL},
    "dcmotor": _actuator(
        "motorconst resistance nominal", "cogging controller inductance input lugre saturation thermal"
    ),
    "actuator/plugin": {"carried": "instance plugin", "listed": ALL},
    "sensor": {"idle": ALL},
    "custom": {"idle": ALL},
    "key": {"carried": "ctrl qpos qvel", "listed": "act mpos mquat", "idle": "plastic time"},
}


def kind_of(path: tuple[str, ...], attribute: str) -> Kind | None:
    """Return how an attribute is treated, by the path of its element; None if it is unknown."""
    if attribute in _NO_EFFECT.split():
        return "idle"
    for end in range(len(path), 0, -1):
        keys = ("/".join(path[max(end - 2, 0) : end]), path[end - 1])
        kinds = next((SCHEMA[key] for key in keys if key in SCHEMA), None)
        if kinds is not None:
            element_kind: Kind | None = next((kind for kind, names in kinds.items() if names == ALL), None)
            listed = (kind for kind, names in kinds.items() if attribute in names.split())
            # Children are as an element of which all is the same.
            return (next(listed, None) if end == len(path) else None) or element_kind
    return None
