//! Kernels with the number of rows per vertex as a constant, chosen at run time.

/// Evaluates an expression in which `$M` is the constant 1, 2, 3 or 4 that `$rows` is.
macro_rules! by_rows {
    ($rows:expr, $M:ident => $kernel:expr) => {{
        macro_rules! with_rows {
            ($constant:literal) => {{
                const $M: usize = $constant;
                $kernel
            }};
        }
        match $rows {
            1 => with_rows!(1),
            2 => with_rows!(2),
            3 => with_rows!(3),
            _ => with_rows!(4),
        }
    }};
}

pub(crate) use by_rows;
