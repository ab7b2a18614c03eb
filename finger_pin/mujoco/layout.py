"""Memory of MuJoCo: offsets in mjModel, mjData and mjContact, for the version at hand.

They follow from the tables that MuJoCo ships (`mujoco.introspect`) by the rules of C, and are compared with the
addresses that NumPy sees, so that a version with another layout is refused in one line.
"""

from __future__ import annotations

import ctypes
from collections import namedtuple
from functools import cache
from typing import Any

import mujoco
import numpy as np
from mujoco.introspect import structs

from finger_pin.exceptions import InputError

_NUMBERS: dict[str, Any] = {
    "int": ctypes.c_int32,
    "mjtNum": ctypes.c_double,
    "float": ctypes.c_float,
    "mjtSize": ctypes.c_int64,
    "mjtByte": ctypes.c_uint8,
    "mjtBool": ctypes.c_bool,
    "char": ctypes.c_char,
    "size_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
    "uintptr_t": ctypes.c_size_t,
}

#: Fields of mjModel, and of its options.
Model = namedtuple(
    "Model",
    "nv ntendon nactuator ntuple timestep integrator jacobian solver noslip_iterations jnt_type jnt_dofadr jnt_qposadr "
    "jnt_bodyid jnt_actfrclimited jnt_actfrcrange body_parentid body_jntadr body_jntnum geom_bodyid tendon_stiffness "
    "tendon_damping tendon_lengthspring tendon_actfrclimited tendon_actfrcrange actuator_trntype actuator_trnid "
    "actuator_gear actuator_forcelimited actuator_forcerange actuator_outadr actuator_plugin actuator_actadr eq_type "
    "eq_obj1id eq_obj2id tuple_adr tuple_size tuple_objtype tuple_objid tuple_objprm names name_actuatoradr "
    "name_tupleadr plugin_stateadr plugin_attr plugin_attradr ten_J_rownnz ten_J_rowadr ten_J_colind",
)
#: Fields of mjData.
Data = namedtuple(
    "Data",
    "ne nf nefc ncon nisland qpos qvel act act_dot ten_length ten_velocity ten_J ten_wrapadr ten_wrapnum wrap_obj "
    "wrap_xpos actuator_force efc_type efc_id efc_frictionloss efc_D efc_R efc_aref efc_force efc_AR efc_AR_rownnz "
    "efc_AR_rowadr efc_AR_colind iefc_frictionloss iefc_D iefc_R map_efc2iefc contact xanchor xmat plugin_data "
    "plugin_state",
)
#: Fields of mjContact, and its size.
Contact = namedtuple("Contact", "frame friction dim geom efc_address size")
#: Numbers of MuJoCo's enumerations.
Kinds = namedtuple(
    "Kinds",
    "joint jointinparent tendon friction_dof friction_tendon limit_tendon equality elliptic pyramidal eq_tendon "
    "of_joint of_tendon pgs discrete dense sparse",
)


@cache
def _structure(name: str) -> type[ctypes.Structure]:
    """Return a struct of MuJoCo as one of ctypes."""
    return _build_struct(name, structs.STRUCTS[name])


def _build_struct(name: str, declared: structs.StructDecl) -> type[ctypes.Structure]:
    fields = [(each.name, _ctype(each.type)) for each in declared.fields]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def _ctype(declared: Any) -> Any:
    kind = type(declared).__name__
    if kind == "PointerType":
        return ctypes.c_void_p
    if kind == "ArrayType":
        array_type = _ctype(declared.inner_type)
        for size in reversed(declared.extents):
            array_type *= int(size)
        return array_type
    if kind == "AnonymousStructDecl":
        return _build_struct("anonymous", declared)
    name = declared.name.removeprefix("struct ").rstrip("_")
    if name in _NUMBERS:
        return _NUMBERS[name]
    # Enumerations are ints.
    return _structure(name) if name in structs.STRUCTS else ctypes.c_int32


def _offsets(owner: str, fields: Any, **offsets: int) -> Any:
    struct = _structure(owner)
    return fields(*(offsets[name] if name in offsets else getattr(struct, name).offset for name in fields._fields))


def layout() -> tuple[Model, Data, Contact, Kinds]:
    """Return offsets in mjModel, mjData and mjContact, bytes, and the numbers of enumerations."""
    version = mujoco.__version__
    try:
        options, start = _structure("mjOption"), _structure("mjModel").opt.offset
        names = ("timestep", "integrator", "jacobian", "solver", "noslip_iterations")
        model = _offsets("mjModel", Model, **{name: start + getattr(options, name).offset for name in names})
        data = _offsets("mjData", Data)
        contact = _offsets("mjContact", Contact, size=ctypes.sizeof(_structure("mjContact")))
        kinds = _kinds()
    except (AttributeError, KeyError) as error:
        raise InputError(f"mujoco {version}", f"friction needs MuJoCo 3.12 or later: {error}") from None
    for what in _disagreements(model, data, contact):
        raise InputError(f"mujoco {version}", f"friction cannot read its {what}: write to the authors of finger_pin")
    return model, data, contact, kinds


def _kinds() -> Kinds:
    trn, cnstr, obj = mujoco.mjtTrn, mujoco.mjtConstraint, mujoco.mjtObj
    return Kinds(
        *(int(each) for each in (trn.mjTRN_JOINT, trn.mjTRN_JOINTINPARENT, trn.mjTRN_TENDON)),
        *(int(each) for each in (cnstr.mjCNSTR_FRICTION_DOF, cnstr.mjCNSTR_FRICTION_TENDON)),
        *(int(each) for each in (cnstr.mjCNSTR_LIMIT_TENDON, cnstr.mjCNSTR_EQUALITY)),
        *(int(each) for each in (cnstr.mjCNSTR_CONTACT_ELLIPTIC, cnstr.mjCNSTR_CONTACT_PYRAMIDAL)),
        *(int(each) for each in (mujoco.mjtEq.mjEQ_TENDON, obj.mjOBJ_JOINT, obj.mjOBJ_TENDON)),
        *(int(each) for each in (mujoco.mjtSolver.mjSOL_PGS, getattr(mujoco.mjtIntegrator, "mjINT_DISCRETE", -1))),
        *(int(each) for each in (mujoco.mjtJacobian.mjJAC_DENSE, mujoco.mjtJacobian.mjJAC_SPARSE)),
    )


_SAMPLE = """
<mujoco><option timestep="0.0123" solver="PGS" jacobian="sparse"/><worldbody><geom type="plane" size="1 1 1"/>
<body pos="0 0 .05">
<joint name="a" type="slide" axis="0 0 1" frictionloss="0.1"/><geom name="g" size=".06" mass="1"/>
<site name="p" pos="0 0 .2"/></body><body pos="1 0 1"><joint name="b" axis="0 1 0" frictionloss="0.1"/>
<geom size=".1" mass="1"/><site name="q" pos="0 0 .1"/></body></worldbody>
<tendon><fixed name="f"><joint joint="a" coef="1"/></fixed><spatial name="s" frictionloss="0.1" limited="true"
 range="0 .1"><site site="p"/><site site="q"/></spatial></tendon>
<equality><tendon tendon1="f" tendon2="s"/></equality>
<actuator><general tendon="f" dyntype="integrator" ctrlrange="0 1"/><motor joint="b"/></actuator>
<custom><tuple name="t"><element objtype="tendon" objname="f" prm="1"/></tuple></custom></mujoco>"""


def _disagreements(model_layout: Model, data_layout: Data, contact: Contact) -> list[str]:
    """Return the fields whose addresses are not those of NumPy's views, on a model that has one of each."""
    model = mujoco.MjModel.from_xml_string(_SAMPLE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    differing = []
    for owner, start, offsets in ((model, model._address, model_layout), (data, data._address, data_layout)):
        for name, offset in offsets._asdict().items():
            source = model.opt if name in ("timestep", "integrator", "jacobian", "solver") else owner
            value = None if name == "contact" else getattr(source, name, getattr(model.opt, name, None))
            if isinstance(value, np.ndarray) and value.size:
                agrees = ctypes.c_size_t.from_address(start + offset).value == value.ctypes.data
            elif isinstance(value, float):
                agrees = ctypes.c_double.from_address(start + offset).value == value
            elif isinstance(value, int | np.integer):
                kind = ctypes.c_int64 if name in ("nv", "ntendon", "nactuator", "ntuple") else ctypes.c_int32
                agrees = kind.from_address(start + offset).value == int(value)
            else:
                continue
            differing += [] if agrees else [name]
    first = ctypes.c_size_t.from_address(data._address + data_layout.contact).value
    contacts = data.contact
    for name in ("frame", "friction", "geom"):
        agrees = getattr(contacts, name).ctypes.data == first + getattr(contact, name)
        differing += [] if agrees else [f"contact.{name}"]
    differing += [] if contacts.dim.strides[0] in (contact.size, 4) else ["contact"]
    return differing
