//! The voxels of an image file in the type that they are stored in.

use crate::image::ImageError;

/// Voxels that are accepted at most, stored or resampled.
pub(crate) const MAX_VOXELS: u64 = 1 << 31;

/// The largest magnitude up to which every integer is an f64.
const EXACT_F64: f64 = 9_007_199_254_740_992.0;

macro_rules! voxel_types {
    ($($variant:ident $type:ident)*) => {
        /// One number per voxel, in the file's order and type.
        #[derive(Debug, Clone, PartialEq)]
        pub enum Voxels {
            $(#[doc = concat!("Stored as ", stringify!($type), ".")] $variant(Vec<$type>),)*
        }

        /// How a number is stored.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum VoxelType {
            $(#[doc = concat!("The type ", stringify!($type), ".")] $variant,)*
        }

        impl VoxelType {
            /// Bytes of one voxel.
            pub fn bytes(self) -> u64 {
                match self { $(Self::$variant => size_of::<$type>() as u64,)* }
            }

            /// The name in Rust, e.g. `u16`.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => stringify!($type),)* }
            }
        }

        impl Voxels {
            /// Number of voxels.
            pub fn count(&self) -> usize {
                match self { $(Self::$variant(voxels) => voxels.len(),)* }
            }

            /// Decodes bytes; those of a last, incomplete voxel are dropped.
            pub fn decode(kind: VoxelType, big_endian: bool, bytes: &[u8]) -> Self {
                match kind {
                    $(VoxelType::$variant => {
                        let (chunks, _) = bytes.as_chunks();
                        let decode =
                            if big_endian { $type::from_be_bytes } else { $type::from_le_bytes };
                        Self::$variant(chunks.iter().map(|&chunk| decode(chunk)).collect())
                    })*
                }
            }

            /// Reads `count` numbers, written in decimal and parted by blanks or commas.
            ///
            /// # Errors
            /// [`ImageError::TextVoxel`] for a word that is no number of the type, and where the
            /// text ends too early.
            pub fn parse(
                kind: VoxelType,
                count: usize,
                text: &[u8],
            ) -> Result<Self, ImageError> {
                match kind {
                    $(VoxelType::$variant => {
                        let want = concat!("a number of type ", stringify!($type));
                        parse_words(count, text, want).map(Self::$variant)
                    })*
                }
            }
        }

        /// Runs a generic expression on the vector, whatever its type.
        macro_rules! each_voxel_type {
            ($voxels:expr, $stored:ident => $body:expr) => {
                match $voxels { $($crate::image::voxels::Voxels::$variant($stored) => $body,)* }
            };
        }
        pub(crate) use each_voxel_type;
    };
}
voxel_types!(U8 u8 I8 i8 U16 u16 I16 i16 U32 u32 I32 i32 U64 u64 I64 i64 F32 f32 F64 f64);

/// The number of voxels, unless it is more than can be handled.
pub(crate) fn check_count(dims: [u64; 3]) -> Result<u64, ImageError> {
    let voxels = dims.iter().fold(1u64, |product, &d| product.saturating_mul(d));
    if voxels > MAX_VOXELS {
        return Err(ImageError::TooManyVoxels { dims, voxels, limit: MAX_VOXELS });
    }
    Ok(voxels)
}

fn parse_words<T: std::str::FromStr>(
    count: usize,
    text: &[u8],
    want: &'static str,
) -> Result<Vec<T>, ImageError> {
    let mut words = text
        .split(|byte| byte.is_ascii_whitespace() || *byte == b',')
        .filter(|word| !word.is_empty());
    // A number takes two bytes at least, whatever the header claims.
    let mut voxels = Vec::with_capacity(count.min(text.len() / 2 + 1));
    for index in 0..count {
        let word = words.next().unwrap_or_default();
        match str::from_utf8(word).ok().and_then(|word| word.parse().ok()) {
            Some(value) => voxels.push(value),
            None => {
                let value = String::from_utf8_lossy(word).chars().take(80).collect();
                return Err(ImageError::TextVoxel { index, value, want });
            }
        }
    }
    if words.next().is_some() {
        return Err(ImageError::TooLong { unit: "numbers", want: count as u64 });
    }
    Ok(voxels)
}

/// A stored voxel before scaling; integers stay integers, since f64 holds them only to 2⁵³.
#[derive(Clone, Copy)]
pub(crate) enum Sample {
    Integer(i64),
    Float(f64),
}

macro_rules! sample_from {
    ($variant:ident: $($number:ty)*) => {$(
        impl From<$number> for Sample {
            fn from(value: $number) -> Self {
                Self::$variant(value.into())
            }
        }
    )*};
}
sample_from!(Integer: u8 i8 u16 i16 u32 i32 i64);
sample_from!(Float: f32 f64);

impl From<u64> for Sample {
    /// Beyond i64 it becomes a float, which is too large for a label and good for intensities.
    fn from(value: u64) -> Self {
        i64::try_from(value).map_or(Self::Float(value as f64), Self::Integer)
    }
}

impl Sample {
    pub fn scaled(self, scale: Option<[f64; 2]>) -> Self {
        let Some([slope, inter]) = scale else { return self };
        Self::Float(self.value() * slope + inter)
    }

    pub fn value(self) -> f64 {
        match self {
            Self::Integer(value) => value as f64,
            Self::Float(value) => value,
        }
    }

    pub fn label(self) -> Option<i64> {
        match self {
            Self::Integer(value) => Some(value),
            // NaN and infinity fail the comparison of magnitudes.
            Self::Float(value) => {
                (value.abs() <= EXACT_F64 && value.fract() == 0.0).then_some(value as i64)
            }
        }
    }
}
