//! How tests start processes together.

/// As root, on as few cores as there are, in a container without a network.
pub const FLAGS: &[&str] = &[
    "--allow-run-as-root",
    "--oversubscribe",
    "--bind-to",
    "none",
    "--mca",
    "plm",
    "isolated",
    "--mca",
    "btl",
    "self,vader",
];
