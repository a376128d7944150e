//! Tests by the clock on the wall, apart from those that take both cores.

mod budgets;
mod haptic;
mod haptic_udp;
