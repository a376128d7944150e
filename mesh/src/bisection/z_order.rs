//! The Z-order of lattice points.

use super::kuhn::Point;

/// The bits of three coordinates interleaved, x lowest: the Z-order of points (G. M. Morton,
/// IBM technical report, 1966). Coordinates of up to 21 bits, not negative.
pub(crate) fn z_order(p: Point) -> u64 {
    // Each step halves the groups of bits and leaves twice as many zeros between them.
    let spread = |c: i32| {
        let mut x = c as u64 & 0x1f_ffff;
        x = (x | x << 32) & 0x001f_0000_0000_ffff;
        x = (x | x << 16) & 0x001f_0000_ff00_00ff;
        x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
        x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
        (x | x << 2) & 0x1249_2492_4924_9249
    };
    spread(p[0]) | spread(p[1]) << 1 | spread(p[2]) << 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn z_order_interleaves_bits() {
        assert_eq!(z_order([0b11, 0, 0]), 0b001_001);
        assert_eq!(z_order([0, 0b101, 0]), 0b010_000_010);
        assert_eq!(z_order([1, 1, 0b10]), 0b100_011);
        assert_eq!(z_order([0x1f_ffff; 3]), (1 << 63) - 1);
        assert_eq!(z_order([1 << 20, 0, 0]), 1 << 60);
    }
}
