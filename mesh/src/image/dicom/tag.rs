//! The elements that the reader looks at, by number and name.

use std::fmt;

use super::error::DicomError;

/// Number (group, element) and keyword of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tag {
    pub number: u32,
    pub keyword: &'static str,
}

impl Tag {
    /// An error about the element's value.
    pub fn refuse(self, value: impl ToString, want: &'static str) -> DicomError {
        DicomError::Tag { tag: self.to_string(), value: value.to_string(), want }
    }
}

impl fmt::Display for Tag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // As the standard prints numbers: (7FE0,0010).
        let [group, element] = [self.number >> 16, self.number & 0xffff];
        let blank = if self.keyword.is_empty() { "" } else { " " };
        write!(f, "{}{blank}({group:04X},{element:04X})", self.keyword)
    }
}

/// Number of any element, with its keyword if the reader looks at it.
pub(super) fn named(number: u32) -> String {
    let known = KNOWN.iter().find(|tag| tag.number == number);
    known.unwrap_or(&Tag { number, keyword: "" }).to_string()
}

macro_rules! tags {
    ($($name:ident $number:literal $keyword:literal;)*) => {
        $(pub(super) const $name: Tag = Tag { number: $number, keyword: $keyword };)*

        const KNOWN: &[Tag] = &[$($name),*];
    };
}
tags! {
    STORAGE_CLASS 0x0002_0002 "MediaStorageSOPClassUID";
    TRANSFER_SYNTAX 0x0002_0010 "TransferSyntaxUID";
    SOP_CLASS 0x0008_0016 "SOPClassUID";
    MODALITY 0x0008_0060 "Modality";
    SERIES_DESCRIPTION 0x0008_103e "SeriesDescription";
    SERIES 0x0020_000e "SeriesInstanceUID";
    POSITION 0x0020_0032 "ImagePositionPatient";
    ORIENTATION 0x0020_0037 "ImageOrientationPatient";
    PLANE_POSITION 0x0020_9113 "PlanePositionSequence";
    PLANE_ORIENTATION 0x0020_9116 "PlaneOrientationSequence";
    SAMPLES 0x0028_0002 "SamplesPerPixel";
    PHOTOMETRIC 0x0028_0004 "PhotometricInterpretation";
    FRAMES 0x0028_0008 "NumberOfFrames";
    ROWS 0x0028_0010 "Rows";
    COLUMNS 0x0028_0011 "Columns";
    PIXEL_SPACING 0x0028_0030 "PixelSpacing";
    BITS_ALLOCATED 0x0028_0100 "BitsAllocated";
    BITS_STORED 0x0028_0101 "BitsStored";
    HIGH_BIT 0x0028_0102 "HighBit";
    PIXEL_REPRESENTATION 0x0028_0103 "PixelRepresentation";
    INTERCEPT 0x0028_1052 "RescaleIntercept";
    SLOPE 0x0028_1053 "RescaleSlope";
    MODALITY_LUT 0x0028_3000 "ModalityLUTSequence";
    PIXEL_MEASURES 0x0028_9110 "PixelMeasuresSequence";
    VALUE_TRANSFORMATION 0x0028_9145 "PixelValueTransformationSequence";
    SHARED_GROUPS 0x5200_9229 "SharedFunctionalGroupsSequence";
    FRAME_GROUPS 0x5200_9230 "PerFrameFunctionalGroupsSequence";
    OFFSETS 0x7fe0_0001 "ExtendedOffsetTable";
    FLOAT_PIXELS 0x7fe0_0008 "FloatPixelData";
    DOUBLE_PIXELS 0x7fe0_0009 "DoubleFloatPixelData";
    PIXELS 0x7fe0_0010 "PixelData";
}
