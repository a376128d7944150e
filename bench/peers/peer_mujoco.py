"""MuJoCo: an elastic 3D flex of Yawara's tetrahedra, stepped with damping until it rests."""

import time
from functools import partial

import numpy as np
from case import (
    BASE_M,
    DENSITY_KG_M3,
    GRAVITY_M_S2,
    POISSON_RATIO,
    YOUNG_MODULUS_PA,
    Candidate,
    Failure,
    Solution,
    TetMesh,
    at_ends,
)

NEEDS = {"mujoco": "mujoco"}
RESIDUAL = 1e-4
"""Unbalanced force relative to the weight at which the body rests: each digit takes as long."""
DAMPING_PER_S = 60.0
"""Force of damping per mass and velocity: about critical for the slowest mode."""
MOST_S = {True: 10.0, False: 120.0}
"""Wall clock after which a quick or a full run gives up."""


def scene(mesh: TetMesh, step_s: float) -> str:
    """The model: one flex, its end vertices pinned, no contact."""
    points = " ".join(f"{x:.9g}" for x in mesh.points.ravel())
    tets = " ".join(str(i) for i in mesh.tets.ravel())
    pins = " ".join(str(i) for i in np.flatnonzero(at_ends(mesh.points)))
    return f"""<mujoco>
  <option gravity="0 0 {-GRAVITY_M_S2}" timestep="{step_s:.9g}">
    <flag contact="disable"/>
  </option>
  <worldbody>
    <flexcomp name="beam" type="direct" dim="3" mass="1" radius="1e-4"
        point="{points}" element="{tets}">
      <elasticity young="{YOUNG_MODULUS_PA[1]}" poisson="{POISSON_RATIO}"/>
      <contact selfcollide="none"/>
      <pin id="{pins}"/>
    </flexcomp>
  </worldbody>
</mujoco>"""


def rest(mesh: TetMesh, limit_s: float) -> Solution:
    """Equilibrium as where the damped motion ends; raises `Failure` after `limit_s`."""
    import mujoco

    # Without this a file of warnings appears in the current directory.
    warnings: list[str] = []
    mujoco.set_mju_user_warning(warnings.append)
    begin = time.perf_counter()
    stiffest = max(YOUNG_MODULUS_PA.values())
    wave = (1 - POISSON_RATIO) / ((1 + POISSON_RATIO) * (1 - 2 * POISSON_RATIO)) * stiffest
    edge = BASE_M / 2 ** (mesh.level / 3)
    model = mujoco.MjModel.from_xml_string(scene(mesh, 0.2 * edge / (wave / DENSITY_KG_M3) ** 0.5))
    # A flex has one modulus and vertices of one mass; stiffness is linear in the modulus.
    young = np.array([YOUNG_MODULUS_PA[int(label)] for label in mesh.labels])
    per_tet = model.flex_stiffness.reshape(len(mesh.tets), -1)
    per_tet *= (young / YOUNG_MODULUS_PA[1])[:, None]
    mass = np.bincount(
        mesh.tets.ravel(), np.repeat(mesh.volumes() * DENSITY_KG_M3 / 4, 4), len(mesh.points)
    )
    bodies = model.flex_vertbodyid
    free = ~at_ends(mesh.points)
    model.body_mass[bodies[free]] = mass[free]
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    model.dof_damping[:] = DAMPING_PER_S * mass[free].repeat(3)
    mujoco.mj_resetData(model, data)
    warnings.clear()  # the flex has no equality constraints: its forces are elastic ones
    ready = time.perf_counter()
    weight = np.linalg.norm(mass[free]) * GRAVITY_M_S2
    steps, residual = 0, np.inf
    while residual > RESIDUAL:
        mujoco.mj_step(model, data, 100)
        steps += 100
        # At rest every force is elastic or weight: what is left of them is what accelerates.
        balance = data.qfrc_passive - data.qfrc_bias + model.dof_damping * data.qvel
        residual = float(np.linalg.norm(balance)) / weight
        if warnings or not np.isfinite(residual):
            raise Failure(f"{(warnings or ['not finite'])[0]} after {steps} steps")
        if time.perf_counter() - ready > limit_s:
            raise Failure(f"residual {residual:.1e} after {limit_s:.0f} s, {steps} steps")
    done = time.perf_counter()
    mujoco.mj_kinematics(model, data)
    mujoco.mj_flex(model, data)
    moved = np.array(data.flexvert_xpos) - mesh.points
    return Solution(moved, model.nv, ready - begin, done - ready, residual, steps)


def candidates(meshes: list[TetMesh], quick: bool) -> list[Candidate]:
    """The flex on all meshes: a fine one may end at its limit."""
    return [Candidate("MuJoCo flex", "StVK", m, partial(rest, m, MOST_S[quick])) for m in meshes]
