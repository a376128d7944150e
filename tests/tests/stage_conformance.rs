//! Every choice of a stage passes the suite of that stage; a new one gets it with one line.

use nalgebra::Vector3;
use yawara::{BodyState, SimError, Simulation, Tool, indicator};
use yawara_corot::{
    EQUILIBRIA, FORCES, INTEGRATORS, LAWS, equilibrium_by_name, forces_by_name, integrator_by_name,
    law_by_name,
};
use yawara_embed::{CHOICES, Dynamic, FORMULATIONS, Mass, P1, P1P1, StepWeights, by_name};
use yawara_tests::conformance;
use yawara_tests::stage_suites::tool::by_entry;

conformance!(
    homogenisation,
    laminate,
    "laminate",
    one_material_stays_itself,
    parents_are_no_stiffer_than_the_voigt_mean
);
conformance!(
    homogenisation,
    linear,
    "linear",
    one_material_stays_itself,
    parents_are_no_stiffer_than_the_voigt_mean
);
conformance!(
    homogenisation,
    hierarchical,
    "hierarchical",
    one_material_stays_itself,
    parents_are_no_stiffer_than_the_voigt_mean
);
conformance!(
    homogenisation,
    kharevych,
    "kharevych",
    one_material_stays_itself,
    parents_are_no_stiffer_than_the_voigt_mean
);
// Softer at every level, even of one material.
conformance!(homogenisation, paper_rule, "paper", parents_are_no_stiffer_than_the_voigt_mean);

conformance!(element_formulation, p1, &P1);
conformance!(element_formulation, p1p1, &P1P1::default());
conformance!(element_formulation, p1p1_little_stabilised, &P1P1::new(0.5).unwrap());
conformance!(element_formulation, p1p1_much_stabilised, &P1P1::new(2.0).unwrap());
conformance!(
    element_formulation,
    p1_in_time,
    &Dynamic { element: P1, weights: weights(Mass::Consistent) }
);
conformance!(
    element_formulation,
    p1_lumped,
    &Dynamic { element: P1, weights: weights(Mass::Lumped) }
);
conformance!(
    element_formulation,
    p1p1_in_time,
    &Dynamic { element: P1P1::default(), weights: weights(Mass::Consistent) }
);

/// Mass and stiffness of like size: ρ h² c against E.
fn weights(mass: Mass) -> StepWeights {
    StepWeights { mass, mass_per_s2: 1e4, stiffness: 1.0 }
}

conformance!(
    internal_forces,
    element,
    "element",
    a_stretch_gives_the_linear_force,
    a_translation_gives_no_force,
    a_rotation_gives_no_force,
    small_displacements_give_the_linear_force,
    forces_balance
);
conformance!(
    internal_forces,
    element_reference,
    "element_reference",
    a_stretch_gives_the_linear_force,
    a_translation_gives_no_force,
    a_rotation_gives_no_force,
    small_displacements_give_the_linear_force,
    forces_balance
);
// Ghost forces: the ends of an edge see different rotations.
conformance!(
    internal_forces,
    row,
    "row",
    a_stretch_gives_the_linear_force,
    a_translation_gives_no_force,
    a_rotation_gives_no_force,
    small_displacements_give_the_linear_force
);
// Turns about the origin, where neighbours turn differently: promises nothing more.
conformance!(internal_forces, paper, "paper", a_stretch_gives_the_linear_force);
conformance!(
    internal_forces,
    none,
    "none",
    a_stretch_gives_the_linear_force,
    a_translation_gives_no_force,
    small_displacements_give_the_linear_force,
    forces_balance
);

// Springs are another material.
conformance!(
    internal_forces,
    mass_spring,
    "mass_spring",
    a_translation_gives_no_force,
    a_rotation_gives_no_force,
    forces_balance
);

conformance!(constitutive_law, linear_law, "linear");
conformance!(constitutive_law, rayleigh, "rayleigh");
conformance!(constitutive_law, neo_hookean, "neo_hookean");
conformance!(constitutive_law, prony, "prony");
conformance!(constitutive_law, plastic, "plastic");
conformance!(constitutive_law, creep, "creep");

conformance!(equilibrium, fallback, "fallback", a_large_load_is_borne);
conformance!(equilibrium, anderson, "anderson", a_large_load_is_borne);
conformance!(equilibrium, lbfgs, "lbfgs", a_large_load_is_borne);
// Diverges as soon as rotations differ by some degrees.
conformance!(equilibrium, direct, "direct");
conformance!(equilibrium, newton, "newton", a_large_load_is_borne);
conformance!(equilibrium, residual_newton, "residual_newton", a_large_load_is_borne);

conformance!(time_integrator, implicit_euler, ("implicit_euler", 1.0));
conformance!(time_integrator, newmark, ("newmark", 2.0));
conformance!(time_integrator_without_inertia, quasi_static, "quasi_static");

conformance!(indicator, energy, "energy");
conformance!(indicator, volume, "volume");
conformance!(indicator, rotation, "rotation");

conformance!(
    tool,
    grab,
    &by_entry(
        "{ kind = 'grab', release_s = 1.1, region = { shape = 'box', min = [1, 0, 0], max = [1, 1, 1] },
           path = [{ time_s = 0 }, { time_s = 1, move_m = [0.003, 0, 0.01] }] }"
    )
);
conformance!(
    tool,
    grab_by_the_mean,
    &by_entry(
        "{ kind = 'grab', hold = 'mean', release_s = 1.1,
           region = { shape = 'box', min = [0.9, 0, 0], max = [1, 1, 1] },
           path = [{ time_s = 0 }, { time_s = 1, move_m = [0.003, 0, 0.01], turn_deg = 10 }] }"
    )
);
conformance!(
    tool,
    grab_by_a_pad,
    &by_entry(
        "{ kind = 'grab', hold = 'pad', release_s = 1.1,
           region = { shape = 'sphere', centre = [1, 0.5, 0.5], radius_m = 0.012 },
           path = [{ time_s = 0 }, { time_s = 1, move_m = [0.003, 0, 0.01] }] }"
    )
);
conformance!(
    tool,
    probe,
    &by_entry(
        "{ kind = 'probe', release_s = 1.1, centre = [0.9, 0.5, 1.3], radius_m = 0.012,
           path = [{ time_s = 0 }, { time_s = 1, move_m = [0, 0, -0.01] }] }"
    )
);
conformance!(
    tool,
    pressure,
    &by_entry(
        "{ kind = 'pressure', region = { shape = 'box', min = [0.5, 0, 0.9], max = [1, 1, 1] },
           pressure = [{ time_s = 0, pressure_pa = 0 }, { time_s = 1, pressure_pa = 200 },
                       { time_s = 1.5, pressure_pa = 0 }] }"
    )
);
conformance!(
    tool,
    load_on_material,
    &by_entry(
        "{ kind = 'load', region = { shape = 'box', min = [0.6, 0, 0], max = [1, 1, 1] },
           load = [{ time_s = 0 },
                   { time_s = 1, force_n = [0.02, 0, 0.2], torque_n_m = [0.003, 0, 0] },
                   { time_s = 1.5 }] }"
    )
);
conformance!(
    tool,
    load_on_the_surface,
    &by_entry(
        "{ kind = 'load', region = { shape = 'box', min = [0.5, 0, 0.9], max = [1, 1, 1] },
           load = [{ time_s = 0 }, { time_s = 1, traction_pa = [0, 50, 50] }, { time_s = 1.5 }] }"
    )
);
conformance!(
    tool,
    load_on_a_point,
    &by_entry(
        "{ kind = 'load', at_mm = [78, 3, 4],
           load = [{ time_s = 0 }, { time_s = 1, force_n = [0, 0.05, 0.1] }, { time_s = 1.5 }] }"
    )
);
conformance!(tool, one_of_your_own, &|scene| {
    Simulation::builder(&scene).tool(|_| Ok::<_, SimError>(Wind)).build()
});

/// Up to a second a force on everything, in proportion to its time.
struct Wind;

impl Tool for Wind {
    fn kind(&self) -> &'static str {
        "wind"
    }

    fn reference(&self, _: f64) -> Vector3<f64> {
        Vector3::zeros()
    }

    fn acts_at(&self, t: f64) -> bool {
        t <= 1.1
    }

    fn add_loads(&self, body: &BodyState, t: f64, loads: &mut [Vector3<f64>]) {
        let share = 0.1 / body.vertices().count() as f64;
        for v in body.vertices().filter(|_| self.acts_at(t)) {
            loads[v.index()] += Vector3::new(0.0, 0.3, -1.0) * share * t;
        }
    }
}

#[test]
fn every_choice_has_its_line() {
    assert_eq!(CHOICES, ["laminate", "linear", "hierarchical", "kharevych", "paper"]);
    assert_eq!(FORMULATIONS, ["p1", "p1p1"]);
    let equilibria = ["fallback", "anderson", "lbfgs", "direct", "newton", "residual_newton"];
    assert_eq!(EQUILIBRIA, equilibria);
    assert_eq!(indicator::CHOICES, ["energy", "residual", "goal", "volume", "rotation"]);
    assert_eq!(FORCES, ["element", "element_reference", "row", "paper", "none", "mass_spring"]);
    assert_eq!(LAWS, ["linear", "rayleigh", "neo_hookean"]);
    assert_eq!(INTEGRATORS, ["implicit_euler", "newmark", "quasi_static"]);
}

#[test]
fn every_choice_has_its_name() {
    for name in CHOICES {
        assert_eq!(by_name(name).unwrap().name(), *name);
    }
    for name in EQUILIBRIA {
        assert_eq!(equilibrium_by_name(name).unwrap().name(), *name);
    }
    for name in indicator::CHOICES {
        let indicator = indicator::by_name(name).unwrap();
        assert_eq!(indicator.name(), *name);
        assert!(!indicator.unit().is_empty());
    }
    for name in FORCES {
        assert_eq!(forces_by_name(name).unwrap().name(), *name);
    }
    for name in LAWS {
        assert_eq!(law_by_name(name, 0.05).unwrap().name(), *name);
    }
    for name in INTEGRATORS {
        assert_eq!(integrator_by_name(name).unwrap().name(), *name);
    }
}
