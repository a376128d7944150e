//! Every co-rotation, law and integrator passes the suite of its stage; a new one gets it with one
//! line.

use yawara_corot::{FORCES, INTEGRATORS, LAWS};
use yawara_tests::{constitutive_law_suite, internal_forces_suite, time_integrator_suite};

internal_forces_suite!(
    element,
    "element",
    a_translation_gives_no_force,
    a_rotation_gives_no_force,
    small_displacements_give_the_linear_force,
    forces_balance
);
internal_forces_suite!(
    element_reference,
    "element_reference",
    a_translation_gives_no_force,
    a_rotation_gives_no_force,
    small_displacements_give_the_linear_force,
    forces_balance
);
// Ghost forces: the ends of an edge see different rotations.
internal_forces_suite!(
    row,
    "row",
    a_translation_gives_no_force,
    a_rotation_gives_no_force,
    small_displacements_give_the_linear_force
);
// Turns about the origin, where neighbours turn differently: promises nothing more.
internal_forces_suite!(paper, "paper");
internal_forces_suite!(
    none,
    "none",
    a_translation_gives_no_force,
    small_displacements_give_the_linear_force,
    forces_balance
);

constitutive_law_suite!(linear, "linear");
constitutive_law_suite!(rayleigh, "rayleigh");

time_integrator_suite!(implicit_euler, "implicit_euler", 1.0);
time_integrator_suite!(quasi_static, "quasi_static", static);

#[test]
fn every_choice_has_its_line() {
    assert_eq!(FORCES, ["element", "element_reference", "row", "paper", "none"]);
    assert_eq!(LAWS, ["linear", "rayleigh"]);
    assert_eq!(INTEGRATORS, ["implicit_euler", "quasi_static"]);
}
