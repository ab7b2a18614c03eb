"""A model with friction is a model like any other: copied, saved, attached, stepped in threads and differentiated."""

import copy
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np
import pytest
from mujoco import rollout
from mujoco_models import ROUTED

import finger_pin as fp

FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
STEPS = 300


def spec():
    """Return two links with every kind of path, actuators, springs and a ball that hits them, and friction of all."""
    found = mujoco.MjSpec.from_string(ROUTED.replace('<flag contact="disable"/>', ""))
    ball = found.worldbody.add_body(name="ball", pos=[0.08, 0.0, 0.1])
    ball.add_freejoint()
    ball.add_geom(size=[0.01, 0, 0], mass=0.02)
    fp.mujoco.add_friction(found, tendons={"*": {"coulomb": 0.12}}, joints={"*": {}})
    return found


@pytest.fixture(scope="module")
def model():
    return spec().compile()


CONTROLS = np.array([[np.sin(0.01 * k), 5.0 + 5.0 * np.sin(0.02 * k), np.cos(0.013 * k)] for k in range(STEPS)])


def motion(model, data=None, first=0, steps=STEPS):
    """Return the state after steps."""
    data = mujoco.MjData(model) if data is None else data
    for control in CONTROLS[first:steps]:
        data.ctrl[:] = control
        mujoco.mj_step(model, data)
    return np.concatenate([data.qpos, data.qvel, data.act])


def test_copies_threads_rollouts_binaries_and_pickles_move_alike_to_the_last_bit(model):
    whole = motion(model)
    half = mujoco.MjData(model)
    motion(model, half, steps=STEPS // 2)
    other = copy.copy(half)
    assert np.array_equal(motion(model, half, STEPS // 2), whole)
    assert np.array_equal(motion(model, other, STEPS // 2), whole)
    with ThreadPoolExecutor(4) as threads:
        assert all(np.array_equal(each, whole) for each in threads.map(lambda _: motion(model), range(8)))
    binary = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, binary)
    for same in (
        copy.deepcopy(model),
        pickle.loads(pickle.dumps(model)),
        mujoco.MjModel.from_binary_path("m.mjb", {"m.mjb": bytes(binary)}),
    ):
        assert np.array_equal(motion(same), whole)
    start = np.empty(mujoco.mj_stateSize(model, FULL))
    mujoco.mj_getState(model, mujoco.MjData(model), start, FULL)
    workers = [mujoco.MjData(model) for _ in range(2)]
    states, _ = rollout.rollout([model] * 4, workers, np.tile(start, (4, 1)), np.tile(CONTROLS, (4, 1, 1)))
    ends = states[:, -1, 1 : 1 + len(whole)]
    assert all(np.array_equal(each, whole) for each in ends)


@pytest.mark.parametrize("persistent", [False, True])
def test_a_batch_of_simulations_on_threads_moves_as_one_does_to_the_last_bit(model, persistent):
    batches = pytest.importorskip("mujoco.batch", reason="comes with MuJoCo 4.0")
    batch = batches.Batch(model, nsim=5, nthread=2, persistent=persistent)
    starts, found = [0, 20, 40, 60, 80], [batch.bind(name) for name in ("qpos", "qvel", "act")]
    for k in range(100):
        batch.bind("ctrl")[:] = [CONTROLS[first + k] for first in starts]
        batch.step()
    for i, first in enumerate(starts):
        assert np.array_equal(np.concatenate([each[i] for each in found]), motion(model, None, first, first + 100))


def test_xml_keeps_the_friction_and_the_number_of_controls(model):
    again = mujoco.MjModel.from_xml_string(spec().to_xml())
    assert (again.nu, again.na) == (model.nu, model.na) == (3, 8 + 3 * 3)
    np.testing.assert_allclose(motion(again, steps=50), motion(model, steps=50), atol=1e-4)
    data = mujoco.MjData(again)
    motion(again, data, steps=50)
    signals = fp.mujoco.friction(again, data)
    assert all(signals.level[signals.index(name)] > 5e-4 for name in ("top", "branched", "sum", "j1", "j2", "slider"))


@pytest.mark.filterwarnings("ignore:Attach conflict")
def test_two_attached_hands_move_as_one_alone(model):
    parent = mujoco.MjSpec()
    parent.option.gravity = [1.0, 2.0, -9.0]
    for place, prefix in enumerate(("left_", "right_")):
        parent.attach(spec(), prefix=prefix, frame=parent.worldbody.add_frame(pos=[place, 0.0, 0.0]))
    both = parent.compile()
    one, two = mujoco.MjData(model), mujoco.MjData(both)
    for control in CONTROLS[:20]:
        one.ctrl[:], two.ctrl[:] = control, np.tile(control, 2)
        mujoco.mj_step(model, one)
        mujoco.mj_step(both, two)
    signals, alone = fp.mujoco.friction(both, two), fp.mujoco.friction(model, one)
    assert signals.names[0] == "left_top" and signals.names[len(alone.names)] == "right_top"
    np.testing.assert_allclose(signals.level, np.tile(alone.level, 2), rtol=1e-6)


def test_finite_differences_of_mujoco_are_those_of_its_step(model):
    data, size = mujoco.MjData(model), 2 * model.nv + model.na
    motion(model, data, steps=40)
    found, by_control = np.zeros((size, size)), np.zeros((size, model.nu))
    mujoco.mjd_transitionFD(model, data, 1e-7, True, found, by_control, None, None)

    def step(change):
        other, nv = copy.copy(data), model.nv
        mujoco.mj_integratePos(model, other.qpos, change[:nv], 1.0)
        other.qvel += change[nv : 2 * nv]
        other.act += change[2 * nv : size]
        other.ctrl += change[size:]
        mujoco.mj_step(model, other)
        moved = np.zeros(nv)
        mujoco.mj_differentiatePos(model, moved, 1.0, data.qpos, other.qpos)
        return np.concatenate([moved, other.qvel, other.act])

    changes = 1e-7 * np.eye(size + model.nu)
    expected = np.transpose([(step(each) - step(-each)) / 2e-7 for each in changes])
    np.testing.assert_allclose(np.hstack([found, by_control]), expected, atol=1e-5 * abs(expected).max())


def test_signals_are_mujoco_s_own_memory(model):
    data = mujoco.MjData(model)
    signals = fp.mujoco.friction(model, data)
    motion(model, data, steps=30)
    branches = ("branched_branch_1", "branched_branch_2")
    assert signals.names == ("top", "branched", *branches, "sum", "j1", "j2", "slider")
    assert signals.tension[signals.index("branched")] == pytest.approx(data.ctrl[1], rel=0.1)
    np.testing.assert_array_equal(signals.bristle, data.act[:8])
    rows = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON
    # The solver's rows are in the order of the model's tendons.
    names = [model.tendon(i).name for i in range(model.ntendon)]
    order = [signals.index(name) for name in names if name in signals.names]
    np.testing.assert_array_equal(signals.friction[order], -data.efc_force[: data.nefc][rows])


@pytest.mark.slow
def test_a_process_that_has_not_imported_us_is_told_what_is_missing_by_the_xml():
    text = spec().to_xml()
    code = (
        "import sys, mujoco\n"
        "try:\n    mujoco.MjModel.from_xml_string(sys.stdin.read())\nexcept ValueError as error:\n    print(error)"
    )
    told = subprocess.run([sys.executable, "-c", code], input=text, capture_output=True, text=True, check=True).stdout
    assert "finger_pin.friction" in told


@pytest.mark.slow
def test_a_binary_or_pickled_model_moves_alike_in_a_process_that_imports_us_first_and_is_lost_in_one_that_does_not(
    model,
):
    whole, kept = motion(model, steps=50), pickle.dumps((pickle.dumps(model), CONTROLS[:50]))
    load = "import pickle, sys\nmodel, controls = pickle.loads(sys.stdin.buffer.read())\n"
    code = load + (
        "import mujoco\nmodel = pickle.loads(model)\ndata = mujoco.MjData(model)\n"
        "for each in controls:\n    data.ctrl[:] = each\n    mujoco.mj_step(model, data)\n"
        "print(*[x.hex() for x in (*data.qpos, *data.qvel, *data.act)])"
    )
    ours, without = (
        subprocess.run([sys.executable, "-c", first + code], input=kept, capture_output=True, check=False)
        for first in ("import finger_pin.mujoco\n", "")
    )
    assert ours.returncode == 0 and [float.fromhex(each) for each in ours.stdout.decode().split()] == whole.tolist()
    # MuJoCo does not tell: it crashes, or goes on without friction in a version that does not.
    assert without.returncode != 0 or ours.stdout != without.stdout


SERVO = """<mujoco><compiler angle="radian"/><default>{default}</default><worldbody><body>
  <joint name="hinge" axis="0 1 0" range="-0.2 1.2" limited="true"/>
  <geom type="capsule" size="0.008" fromto="0 0 0 0.06 0 0"/></body></worldbody>
  <tendon><fixed name="cord"><joint joint="hinge" coef="0.008"/></fixed></tendon>
  <actuator><position joint="hinge" kp="1" ctrlrange="0 1" {own}/></actuator></mujoco>"""


@pytest.mark.parametrize(
    "settings",
    ['ctrllimited="true" forcelimited="true" forcerange="-1 1"', 'delay="0.01" nsample="20"', 'dampratio="1"', ""],
)
def test_defaults_of_a_model_act_on_its_actuators_alone(settings):
    angles = []
    for places in ({"default": f"<position {settings}/>", "own": ""}, {"default": "", "own": settings}):
        spec = mujoco.MjSpec.from_string(SERVO.format(**places))
        fp.mujoco.add_friction(spec, tendons={"*": {"coulomb": 0.1, "curvature_offset": 1.0}}, joints={"*": {}})
        for model in (spec.compile(), mujoco.MjModel.from_xml_string(spec.to_xml())):
            data = mujoco.MjData(model)
            data.ctrl[:] = 0.5
            mujoco.mj_step(model, data, 200)
            angles.append(data.qpos[0])
    # XML has fewer digits of what MuJoCo resolves.
    assert np.ptp(angles) < 1e-9 < angles[0]
